//! Parameters of a path.

use crate::error::ApiError;
use axum::extract::{FromRequestParts, Path as RawPath};
use axum::http::request::Parts;
use serde::de::DeserializeOwned;

/// The parameters of a request's path. A path that is not UTF-8 is a problem, as every other error is.
#[derive(Debug, Clone)]
pub struct Path<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned + Send> FromRequestParts<S> for Path<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        let RawPath(parameters) = RawPath::from_request_parts(parts, state).await.map_err(|_| ApiError::BadRequest)?;
        Ok(Self(parameters))
    }
}
