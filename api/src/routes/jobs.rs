//! Jobs: submit, list, get, delete, cancel, pause, resume.

use crate::access::{Client, ME};
use crate::base_path::address;
use crate::creation::{Creation, check_capacity};
use crate::error::{ApiError, Problem};
use crate::idempotency::stored_response;
use crate::pagination::{Cursor, PageSize};
use crate::path::Path;
use crate::query::QueryParameters;
use crate::resource::{self, Deletion, Resource};
use crate::response_cache::Version;
use crate::state::AppState;
use crate::store_sources::StoreSources;
use crate::views::{JobList, JobView};
use axum::body::Bytes;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use meniscus_jobs::service::accuracy;
use meniscus_jobs::service::store::{
    Change, ChangeError, IdempotencyKey, JobFilter, JobRow, Made, NewJob, NewStudy, Store, StoreError,
};
use meniscus_jobs::spec::body::JobBody;
use meniscus_jobs::spec::health::HealthStatus;
use meniscus_jobs::spec::states::{Reason, State as JobState, Trigger};
use meniscus_jobs::system::clock;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Unexpected, Visitor};
use std::fmt;
use std::time::Duration;

/// Largest body of a job in bytes.
pub const BODY_LIMIT: usize = 1 << 20;
/// Longest time in seconds that `GET` waits for a change.
const LONGEST_WAIT: u64 = 60;

/// Submits a job. An answer 201 is durable: the job survives a crash of the service and of the machine.
#[utoipa::path(post, path = "/v1/jobs", operation_id = "submit_job", tag = "jobs", params(("Idempotency-Key" = Option<String>, Header)),
    request_body(content = Object, description = "a job"),
    responses((status = 201, body = JobView, headers(("Location" = String))), (status = 400, body = Problem),
        (status = 413, body = Problem), (status = 422, body = Problem), (status = 429, body = Problem),
        (status = 503, body = Problem), (status = 507, body = Problem)))]
pub async fn submit(State(state): State<AppState>, request: Request) -> Result<Response, ApiError> {
    let mut creation = Creation::receive(&state, request, BODY_LIMIT).await?;
    let here = state.clone();
    let work = move |store: &Store| {
        let spec = creation.json()?;
        if let Some(made) = creation.known.take() {
            return creation.respond(made);
        }
        let body = StoreSources::new(store).resolve(&spec, here.config.allowance(), &store.calibration()?)?;
        check_capacity(&here, store, 1, body.forecast.disk_bytes)?;
        let lineage = Lineage { owner: creation.owner.clone(), ..Lineage::default() };
        creation.respond(make(&here, store, &body, lineage, creation.keyed.clone())?)
    };
    let response = state.with_store(work).await?;
    state.supervisor.wake();
    Ok(response)
}

/// Where a new job comes from.
#[derive(Debug, Clone, Default)]
pub(super) struct Lineage {
    /// Name of the token that makes it.
    pub(super) owner: Option<String>,
    /// The study that it is a point of, with the point's number.
    pub(super) study: Option<(String, u64)>,
    /// The job that it repeats.
    pub(super) retry_of: Option<String>,
}

/// Makes a job; one that asks for an accuracy together with the study that finds its spacing.
pub(super) fn make(
    state: &AppState,
    store: &Store,
    body: &JobBody,
    lineage: Lineage,
    keyed: Option<IdempotencyKey>,
) -> Result<Made, ApiError> {
    let answer = |row: JobRow| {
        stored_response(StatusCode::CREATED, Some(address(&format!("/v1/jobs/{}", row.id))), &JobView::from(row))
    };
    let Lineage { owner, study, retry_of } = lineage;
    // Earlier runs of the same problem may tell the spacing at once.
    let known = body.wanted.as_ref().map(|wanted| accuracy::known_body(store, body, wanted, state.config.allowance()));
    let known = known.transpose()?.flatten();
    let body = known.as_ref().unwrap_or(body);
    let mut job = if body.wanted.is_some() { NewJob::waiting(body) } else { NewJob::from_body(body) };
    job.owner.clone_from(&owner);
    job.study = study;
    job.retry_of = retry_of;
    if let Some(wanted) = &body.wanted {
        let finding = accuracy::study_for(store, body, wanted, state.config.allowance())?;
        check_capacity(state, store, 2, finding.forecast.disk_bytes)?;
        let finding = NewStudy { owner, ..finding };
        return Ok(store.submit_with_study(job, &finding, keyed.as_ref(), answer)?);
    }
    Ok(store.submit(job, keyed, answer)?)
}

impl Resource for JobRow {
    const NOUN: &'static str = "job";
    const IS_ONE_ROW: bool = true;
    type View = JobView;

    fn id(&self) -> &str {
        &self.id
    }

    fn find(store: &Store, id: &str) -> Result<Option<Self>, StoreError> {
        store.job(id)
    }

    fn owner(&self, _: &Store) -> Result<Option<String>, StoreError> {
        Ok(self.owner.clone())
    }

    fn delete(&self, store: &Store) -> Result<Deletion, StoreError> {
        if store.delete(&self.id)? {
            return Ok(Deletion::Done);
        }
        Ok(Deletion::Refused(format!("The job is {} and cannot be deleted. Cancel it first.", self.state.word())))
    }
}

/// Which jobs of all.
#[derive(Debug, Clone, Default, serde::Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct JobQuery {
    /// One or more states, separated by commas.
    #[serde(default)]
    #[param(value_type = Option<String>)]
    state: Vec<JobState>,
    /// `sound` or `doubtful`.
    #[param(value_type = Option<String>)]
    health: Option<HealthStatus>,
    /// Kind of the scene.
    kind: Option<String>,
    /// Id of a study.
    study: Option<String>,
    /// Name, exactly.
    name: Option<String>,
    /// Name of the token that made it; `me` for the client's own.
    owner: Option<String>,
    /// Value of the label KEY, exactly.
    #[serde(default, rename = "label.KEY")]
    #[param(value_type = Option<String>)]
    labels: Labels,
    /// RFC 3339 time.
    #[param(value_type = Option<String>)]
    created_after: Option<Time>,
    /// RFC 3339 time.
    #[param(value_type = Option<String>)]
    created_before: Option<Time>,
    /// `created_at` for the oldest first, `-created_at` (default) for the newest first.
    #[serde(default)]
    #[param(value_type = Option<String>)]
    sort: Sort,
    /// Entries on the page.
    #[serde(default)]
    #[param(value_type = Option<u64>, minimum = 1, maximum = 500, default = 50)]
    limit: PageSize,
    /// `next` of the page before.
    #[param(value_type = Option<String>)]
    cursor: Option<Cursor>,
}

/// Order of a list of jobs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Deserialize)]
enum Sort {
    #[serde(rename = "created_at")]
    OldestFirst,
    #[default]
    #[serde(rename = "-created_at")]
    NewestFirst,
}

/// A time in the form of the store.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Time(String);

impl<'de> Deserialize<'de> for Time {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let expected = "an RFC 3339 time such as 2026-11-22T01:39:32Z";
        clock::parse(&text).map(Self).ok_or_else(|| D::Error::invalid_type(Unexpected::Str(&text), &expected))
    }
}

/// Keys and values of labels. All of them must hold, also two values of one key.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Labels(Vec<(String, String)>);

impl<'de> Deserialize<'de> for Labels {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Pairs;

        impl<'de> Visitor<'de> for Pairs {
            type Value = Labels;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("labels as label.KEY=VALUE")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Labels, A::Error> {
                let mut pairs = Vec::new();
                while let Some(pair) = map.next_entry()? {
                    pairs.push(pair);
                }
                Ok(Labels(pairs))
            }
        }

        deserializer.deserialize_map(Pairs)
    }
}

impl From<JobQuery> for JobFilter {
    fn from(query: JobQuery) -> Self {
        Self {
            states: query.state,
            health: query.health,
            kind: query.kind,
            study: query.study,
            name: query.name,
            owner: query.owner,
            labels: query.labels.0,
            created_after: query.created_after.map(|time| time.0),
            created_before: query.created_before.map(|time| time.0),
            oldest_first: query.sort == Sort::OldestFirst,
            limit: 0,
            cursor: query.cursor.map(|cursor| cursor.0),
        }
    }
}

/// A page of jobs. New jobs never shift pages.
#[utoipa::path(get, path = "/v1/jobs", operation_id = "list_jobs", tag = "jobs", params(JobQuery),
    responses((status = 200, body = JobList, headers(("Link" = String))), (status = 422, body = Problem)))]
pub async fn list(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    uri: Uri,
    QueryParameters(query): QueryParameters<JobQuery>,
) -> Result<Response, ApiError> {
    page(&state, &client, &uri, query).await
}

/// A page of the jobs that a query selects.
pub(super) async fn page(state: &AppState, client: &Client, uri: &Uri, query: JobQuery) -> Result<Response, ApiError> {
    let size = query.limit;
    let filter = query.filter(client);
    let read = move |store: &Store, limit| store.list(&JobFilter { limit, ..filter });
    resource::page::<JobRow, JobList>(state, uri, size, read).await
}

impl JobQuery {
    /// The filter that the query means for a client.
    pub(super) fn filter(self, client: &Client) -> JobFilter {
        let mut filter = JobFilter::from(self);
        if filter.owner.as_deref() == Some(ME) {
            filter.owner = Some(client.name.clone());
        }
        filter
    }

    /// The same query, of the jobs of one study.
    pub(super) fn with_study(self, study: &str) -> Self {
        Self { study: Some(study.to_owned()), ..self }
    }
}

/// The entity tag of a version.
fn tag((rev, progress): Version) -> String {
    format!("\"{rev}-{progress}\"")
}

/// Whether one of the tags of `If-None-Match` is this one. The comparison is weak, as its standard says.
fn matches_tag(known: &str, tag: &str) -> bool {
    known.trim() == "*" || known.split(',').any(|one| one.trim().trim_start_matches("W/") == tag)
}

/// The revision of a tag `"REV-PROGRESS"`.
pub(super) fn tag_revision(tag: &str) -> Option<i64> {
    tag.trim().trim_start_matches("W/").trim_matches('"').split('-').next()?.parse().ok()
}

/// A job. With `If-None-Match` the answer is 304 if nothing has changed. With `Prefer: wait=N` as well, the answer comes
/// as soon as the revision differs, or after N seconds with the current job.
#[utoipa::path(get, path = "/v1/jobs/{id}", operation_id = "get_job", tag = "jobs",
    params(("id" = String, Path), ("If-None-Match" = Option<String>, Header), ("Prefer" = Option<String>, Header)),
    responses((status = 200, body = JobView, headers(("ETag" = String))), (status = 304), (status = 404, body = Problem)))]
pub async fn get(
    State(state): State<AppState>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let text = |name: header::HeaderName| headers.get(name).and_then(|v| v.to_str().ok()).map(str::to_owned);
    let known = text(header::IF_NONE_MATCH);
    let wait = text(header::HeaderName::from_static("prefer"))
        .and_then(|prefer| prefer.split(',').find_map(|p| p.trim().strip_prefix("wait=")?.parse::<u64>().ok()));
    let mut changes = state.store.watch();
    // Reading two numbers by a key takes less time than handing the work to another thread.
    let read_version = || state.store.version(&id)?.ok_or(ApiError::NotFound("job"));
    let mut version = read_version()?;
    if let (Some(known), Some(wait)) = (&known, wait) {
        let mut stopping = state.stopping.clone();
        let deadline = tokio::time::sleep(Duration::from_secs(wait.min(LONGEST_WAIT)));
        tokio::pin!(deadline);
        while tag_revision(known) == Some(version.0) {
            tokio::select! {
                () = &mut deadline => break,
                _ = stopping.changed() => break,
                _ = changes.changed() => version = read_version()?,
            }
        }
        version = read_version()?;
    } else if known.as_deref().is_some_and(|known| matches_tag(known, &tag(version))) {
        return Ok((StatusCode::NOT_MODIFIED, [(header::ETAG, tag(version))]).into_response());
    }
    if let Some(bytes) = state.response_cache.get(&id, version) {
        return Ok(serialized(version, bytes));
    }
    let row = resource::find::<JobRow>(&state, id.clone()).await?;
    let version = (row.rev, row.progress_count);
    let bytes: Bytes = serde_json::to_vec(&JobView::from(row)).map_err(|e| ApiError::Internal(e.to_string()))?.into();
    state.response_cache.put(&id, version, bytes.clone());
    Ok(serialized(version, bytes))
}

fn serialized(version: Version, bytes: Bytes) -> Response {
    ([(header::CONTENT_TYPE, "application/json".to_owned()), (header::ETAG, tag(version))], bytes).into_response()
}

/// Deletes a job that has ended, with its files. Never cancels.
#[utoipa::path(delete, path = "/v1/jobs/{id}", operation_id = "delete_job", tag = "jobs", params(("id" = String, Path)),
    responses((status = 204), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn delete(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    Path(id): Path<String>,
) -> Result<StatusCode, ApiError> {
    resource::delete::<JobRow>(&state, &client, id).await
}

/// Applies a trigger. A job that is already in the state that follows stays as it is.
async fn request(
    state: &AppState,
    client: &Client,
    id: String,
    trigger: Trigger,
    reason: Option<Reason>,
    already: &'static [JobState],
) -> Result<Response, ApiError> {
    resource::find_own::<JobRow>(state, client, id.clone()).await?;
    let change = Change { reason, ..Change::default() };
    let work = move |store: &Store| match store.change(&id, trigger, &change) {
        Err(ChangeError::Illegal(state, _)) if already.contains(&state) => {
            if trigger == Trigger::Pause {
                store.keep_paused(&id)?;
            }
            store.job(&id)?.ok_or(ApiError::NotFound("job"))
        }
        // Another request changed the job at the same moment: try again with its new state.
        Err(ChangeError::Stale) => Ok(store.change(&id, trigger, &change)?),
        result => Ok(result?),
    };
    let row = state.with_store(work).await?;
    state.supervisor.wake();
    Ok((StatusCode::ACCEPTED, Json(JobView::from(row))).into_response())
}

/// Cancels a job. Repeating the request changes nothing.
#[utoipa::path(post, path = "/v1/jobs/{id}/cancel", operation_id = "cancel_job", tag = "jobs", params(("id" = String, Path)),
    responses((status = 202, body = JobView), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn cancel(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    Path(id): Path<String>,
) -> Result<Response, ApiError> {
    let already = &[JobState::Canceling, JobState::Canceled];
    request(&state, &client, id, Trigger::Cancel, Some(Reason::UserCancel), already).await
}

/// Pauses a job after a checkpoint at the end of its step. Repeating the request changes nothing.
#[utoipa::path(post, path = "/v1/jobs/{id}/pause", operation_id = "pause_job", tag = "jobs", params(("id" = String, Path)),
    responses((status = 202, body = JobView), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn pause(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    Path(id): Path<String>,
) -> Result<Response, ApiError> {
    let already = &[JobState::Pausing, JobState::Paused];
    request(&state, &client, id, Trigger::Pause, Some(Reason::UserPause), already).await
}

/// Returns a paused job to the queue. Repeating the request changes nothing.
#[utoipa::path(post, path = "/v1/jobs/{id}/resume", operation_id = "resume_job", tag = "jobs", params(("id" = String, Path)),
    responses((status = 202, body = JobView), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn resume(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    Path(id): Path<String>,
) -> Result<Response, ApiError> {
    request(&state, &client, id, Trigger::Resume, None, &[JobState::Queued, JobState::Running]).await
}
