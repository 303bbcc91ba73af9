//! Objects that clients list, read and delete by id: jobs, studies, uploads, checkpoints.

use crate::access::Client;
use crate::error::ApiError;
use crate::pagination::{PageSize, link_next};
use crate::state::AppState;
use axum::Json;
use axum::http::{StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use meniscus_jobs::service::store::{Store, StoreError};
use serde::Serialize;

/// A kind of object with an id.
pub trait Resource: Sized + Send + 'static {
    /// Noun for problems.
    const NOUN: &'static str;
    /// Whether `find` reads one row by its key. That takes less time than handing the work to another thread.
    const IS_ONE_ROW: bool;
    /// What clients see of it.
    type View: From<Self> + Serialize;

    /// The id.
    fn id(&self) -> &str;

    /// The object with this id.
    ///
    /// # Errors
    /// [`StoreError`].
    fn find(store: &Store, id: &str) -> Result<Option<Self>, StoreError>;

    /// The client that made it; None where it belongs to all.
    ///
    /// # Errors
    /// [`StoreError`].
    fn owner(&self, store: &Store) -> Result<Option<String>, StoreError>;

    /// Deletes the object with its files, unless its state or its use forbids that.
    ///
    /// # Errors
    /// [`StoreError`].
    fn delete(&self, store: &Store) -> Result<Deletion, StoreError>;
}

/// What became of a request to delete an object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Deletion {
    /// The object is gone.
    Done,
    /// The object stays. The text says why, and what to do first.
    Refused(String),
}

/// The object that a path names.
///
/// # Errors
/// [`ApiError::NotFound`], or a failing store.
pub async fn find<R: Resource>(state: &AppState, id: String) -> Result<R, ApiError> {
    let found = if R::IS_ONE_ROW {
        R::find(&state.store, &id)?
    } else {
        state.with_store(move |store| Ok::<_, ApiError>(R::find(store, &id)?)).await?
    };
    found.ok_or(ApiError::NotFound(R::NOUN))
}

/// The answer to `GET` of an object.
///
/// # Errors
/// As [`find`].
pub async fn get<R: Resource>(state: &AppState, id: String) -> Result<Json<R::View>, ApiError> {
    Ok(Json(find::<R>(state, id).await?.into()))
}

/// The object that a path names, if the client may change it.
///
/// # Errors
/// As [`find`]; [`ApiError::NotOwner`].
pub async fn find_own<R: Resource>(state: &AppState, client: &Client, id: String) -> Result<R, ApiError> {
    let object = find::<R>(state, id).await?;
    check_owner(client, object.owner(&state.store)?)?;
    Ok(object)
}

/// Refuses clients that may not change what an owner made.
///
/// # Errors
/// [`ApiError::NotOwner`].
pub fn check_owner(client: &Client, owner: Option<String>) -> Result<(), ApiError> {
    match owner {
        Some(owner) if !client.may_change(Some(&owner)) => Err(ApiError::NotOwner(owner)),
        _ => Ok(()),
    }
}

/// The answer to `DELETE` of an object.
///
/// # Errors
/// As [`find_own`]; [`ApiError::Conflict`] if it cannot be deleted.
pub async fn delete<R: Resource>(state: &AppState, client: &Client, id: String) -> Result<StatusCode, ApiError> {
    let object = find_own::<R>(state, client, id).await?;
    match state.with_store(move |store| Ok::<_, ApiError>(object.delete(store)?)).await? {
        Deletion::Done => Ok(StatusCode::NO_CONTENT),
        Deletion::Refused(why) => Err(ApiError::Conflict(why)),
    }
}

/// A page of a list, with a link to the next one. `read` reads at most so many objects.
///
/// # Errors
/// A failing store.
pub async fn page<R, L>(
    state: &AppState,
    uri: &Uri,
    size: PageSize,
    read: impl FnOnce(&Store, u64) -> Result<Vec<R>, StoreError> + Send + 'static,
) -> Result<Response, ApiError>
where
    R: Resource,
    L: From<(Vec<R::View>, Option<String>)> + Serialize,
{
    let mut rows = state.with_store(move |store| Ok::<_, ApiError>(read(store, size.rows_to_read())?)).await?;
    let is_more = size.cut(&mut rows);
    let next = rows.last().filter(|_| is_more).map(|row| row.id().to_owned());
    let views = rows.into_iter().map(R::View::from).collect();
    let mut response = Json(L::from((views, next.clone()))).into_response();
    if let Some(cursor) = next {
        link_next(&mut response, uri, &cursor);
    }
    Ok(response)
}
