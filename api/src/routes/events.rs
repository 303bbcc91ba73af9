//! Events of a job or a study: pages of JSON, or a stream of server-sent events.

use crate::error::{ApiError, Problem};
use crate::path::Path;
use crate::query::QueryParameters;
use crate::resource;
use crate::state::AppState;
use crate::views::{EventList, EventView};
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::sse::{Event as SseEvent, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use meniscus_jobs::service::store::{JobRow, Store, StudyRow};
use serde::Deserialize;
use std::convert::Infallible;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

/// Events on a page: default and maximum.
const PAGE: (u64, u64) = (100, 1000);
/// Events that wait for one client. A slow client delays only its own stream.
const QUEUE: usize = 16;
/// Events that are read from the store at once.
const BATCH: u64 = 64;
/// Pause between two readings for one client, so that many changes cause one reading.
const PAUSE: Duration = Duration::from_millis(50);

/// The object that the events belong to.
#[derive(Debug, Clone)]
enum Source {
    Job(String),
    Study(String),
}

impl Source {
    async fn page(&self, state: &AppState, after: u64, limit: u64) -> Result<Vec<EventView>, ApiError> {
        let source = self.clone();
        let read = move |store: &Store| -> Result<Vec<EventView>, ApiError> {
            Ok(match source {
                Self::Job(id) => store.events(&id, after, limit)?.into_iter().map(EventView::from).collect(),
                Self::Study(id) => store
                    .study_events(&id, after, limit)?
                    .into_iter()
                    .map(|(job, event)| EventView { job: Some(job), ..EventView::from(event) })
                    .collect(),
            })
        };
        state.with_store(read).await
    }

    /// Whether all jobs have ended, so that no event can follow.
    async fn has_ended(&self, state: &AppState) -> Result<bool, ApiError> {
        match self {
            Self::Job(id) => Ok(resource::find::<JobRow>(state, id.clone()).await?.state.is_terminal()),
            Self::Study(id) => {
                let row = resource::find::<StudyRow>(state, id.clone()).await?;
                Ok(row.counts.keys().all(|state| state.is_terminal()))
            }
        }
    }
}

/// Which events.
#[derive(Debug, Clone, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct EventQuery {
    /// Number of the event before the first one of the page; 0 by default.
    after: Option<u64>,
    /// Events on the page, 1000 at most.
    #[param(minimum = 0, default = 100)]
    limit: Option<u64>,
}

/// Events of a job after a number: a page of JSON, or with `Accept: text/event-stream` a stream until the job ends.
#[utoipa::path(get, path = "/v1/jobs/{id}/events", operation_id = "job_events", tag = "events",
    params(("id" = String, Path), EventQuery,
        ("Last-Event-ID" = Option<u64>, Header)),
    responses((status = 200, body = EventList), (status = 204, description = "a stream with nothing more to come"),
        (status = 404, body = Problem), (status = 422, body = Problem)))]
pub async fn events(
    State(state): State<AppState>,
    Path(id): Path<String>,
    QueryParameters(query): QueryParameters<EventQuery>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    answer(state, Source::Job(id), query, &headers).await
}

/// Events of all jobs of a study, numbered from 1 within the study. A stream ends when all jobs have ended.
#[utoipa::path(get, path = "/v1/studies/{id}/events", operation_id = "study_events", tag = "studies",
    params(("id" = String, Path), EventQuery,
        ("Last-Event-ID" = Option<u64>, Header)),
    responses((status = 200, body = EventList), (status = 204, description = "a stream with nothing more to come"),
        (status = 404, body = Problem), (status = 422, body = Problem)))]
pub async fn of_study(
    State(state): State<AppState>,
    Path(id): Path<String>,
    QueryParameters(query): QueryParameters<EventQuery>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    answer(state, Source::Study(id), query, &headers).await
}

async fn answer(state: AppState, source: Source, query: EventQuery, headers: &HeaderMap) -> Result<Response, ApiError> {
    let text = |name: &str| headers.get(name).and_then(|v| v.to_str().ok());
    let limit = query.limit.unwrap_or(PAGE.0).clamp(1, PAGE.1);
    let has_ended = source.has_ended(&state).await?;
    if text(header::ACCEPT.as_str()).is_some_and(|accept| accept.contains("text/event-stream")) {
        // A client that has received nothing yet may send an empty header.
        let last = text(LAST_EVENT_ID).filter(|text| !text.trim().is_empty());
        let after = last.map(last_event_id).transpose()?.or(query.after).unwrap_or(0);
        if has_ended && source.page(&state, after, 1).await?.is_empty() {
            return Ok(StatusCode::NO_CONTENT.into_response());
        }
        return Ok(stream(state, source, after));
    }
    let mut items = source.page(&state, query.after.unwrap_or(0), limit + 1).await?;
    let more = items.len() as u64 > limit;
    items.truncate(limit as usize);
    let next = items.last().filter(|_| more).map(|event| event.id);
    Ok(Json(EventList { items, next }).into_response())
}

/// Header with the number of the last event that a client has received.
const LAST_EVENT_ID: &str = "Last-Event-ID";

fn last_event_id(text: &str) -> Result<u64, ApiError> {
    text.trim().parse().map_err(|_| {
        let allowed = "a whole number ≥ 0".into();
        ApiError::invalid(LAST_EVENT_ID, "type", "a whole number is needed", &text.into(), allowed)
    })
}

fn stream(state: AppState, source: Source, after: u64) -> Response {
    let (sender, receiver) = mpsc::channel::<Result<SseEvent, Infallible>>(QUEUE);
    tokio::spawn(async move {
        metrics::gauge!("meniscus_event_streams").increment(1.0);
        feed(state, source, after, sender).await;
        metrics::gauge!("meniscus_event_streams").decrement(1.0);
    });
    let keep_alive = KeepAlive::new().interval(Duration::from_secs(15));
    // Proxies hold answers back until they are whole, unless they are told not to.
    let unbuffered = [(HeaderName::from_static("x-accel-buffering"), HeaderValue::from_static("no"))];
    (unbuffered, Sse::new(ReceiverStream::new(receiver)).keep_alive(keep_alive)).into_response()
}

/// Sends existing events and waits for new ones, until all jobs have ended, the client disconnects, or the service stops.
async fn feed(state: AppState, source: Source, mut after: u64, sender: mpsc::Sender<Result<SseEvent, Infallible>>) {
    let mut changes = state.store.watch();
    let mut stopping = state.stopping.clone();
    loop {
        changes.mark_unchanged();
        let Ok(events) = source.page(&state, after, BATCH).await else {
            return;
        };
        let is_empty = events.is_empty();
        if is_empty {
            // No event follows if the jobs have ended or were deleted.
            let ended = source.has_ended(&state).await.unwrap_or(true);
            let more = source.page(&state, after, 1).await.is_ok_and(|events| !events.is_empty());
            if ended && !more {
                return;
            }
        }
        for event in events {
            after = event.id;
            let message = SseEvent::default().id(event.id.to_string()).event(event.r#type.clone()).json_data(event);
            let Ok(message) = message else { return };
            if sender.send(Ok(message)).await.is_err() {
                return;
            }
        }
        if is_empty {
            tokio::select! {
                _ = changes.changed() => {}
                _ = stopping.wait_for(|stopped| *stopped) => return,
                () = sender.closed() => return,
            }
            tokio::time::sleep(PAUSE).await;
        }
    }
}
