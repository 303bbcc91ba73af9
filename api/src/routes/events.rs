//! The events of a job: pages of JSON, or a stream (SSE).

use crate::application::Application;
use crate::error::{ApiError, Problem};
use crate::routes::{job, number, refuse_unknown, with_store};
use crate::views::{EventList, EventView};
use axum::Json;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::sse::{Event as SseEvent, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use std::convert::Infallible;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

/// Events on a page when nothing is said, and at most.
const PAGE: (u64, u64) = (100, 1000);
/// Events on their way to one client; a slower one waits for itself.
const QUEUE: usize = 16;
/// Events that are read for one client at once.
const AT_ONCE: u64 = 64;
/// Time between two looks for one client: many changes make one look.
const BREATH: Duration = Duration::from_millis(50);

/// Whose events.
#[derive(Debug, Clone)]
enum Source {
    Job(String),
    Study(String),
}

impl Source {
    async fn page(&self, application: &Application, after: u64, limit: u64) -> Result<Vec<EventView>, ApiError> {
        let source = self.clone();
        with_store(application, move |store| {
            Ok(match source {
                Self::Job(id) => store.events(&id, after, limit)?.into_iter().map(EventView::from).collect(),
                Self::Study(id) => store
                    .study_events(&id, after, limit)?
                    .into_iter()
                    .map(|(job, event)| EventView { job: Some(job), ..EventView::from(event) })
                    .collect(),
            })
        })
        .await
    }

    /// Whether nothing can come any more.
    async fn has_ended(&self, application: &Application) -> Result<bool, ApiError> {
        match self {
            Self::Job(id) => Ok(job(application, id).await?.state.is_terminal()),
            Self::Study(id) => {
                let id = id.clone();
                let row = with_store(application, move |store| Ok(store.study(&id)?)).await?;
                let row = row.ok_or(ApiError::NotFound("study"))?;
                Ok(row.counts.keys().all(|state| state.is_terminal()))
            }
        }
    }
}

/// Events after a number: a JSON page, or with `Accept: text/event-stream` a stream that goes on until the job ends.
#[utoipa::path(get, path = "/v1/jobs/{id}/events", tag = "events",
    params(("id" = String, Path), ("after" = Option<u64>, Query), ("limit" = Option<u64>, Query),
        ("Last-Event-ID" = Option<u64>, Header)),
    responses((status = 200, body = EventList), (status = 204, description = "a stream with nothing more to come"),
        (status = 404, body = Problem), (status = 422, body = Problem)))]
pub async fn events(
    State(application): State<Application>,
    Path(id): Path<String>,
    Query(query): Query<Vec<(String, String)>>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    answer(application, Source::Job(id), &query, &headers).await
}

/// The same of all jobs of a study, numbered from 1 in the study; the stream ends when all of them have.
#[utoipa::path(get, path = "/v1/studies/{id}/events", tag = "studies",
    params(("id" = String, Path), ("after" = Option<u64>, Query), ("limit" = Option<u64>, Query),
        ("Last-Event-ID" = Option<u64>, Header)),
    responses((status = 200, body = EventList), (status = 204, description = "a stream with nothing more to come"),
        (status = 404, body = Problem), (status = 422, body = Problem)))]
pub async fn of_study(
    State(application): State<Application>,
    Path(id): Path<String>,
    Query(query): Query<Vec<(String, String)>>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    answer(application, Source::Study(id), &query, &headers).await
}

async fn answer(
    application: Application,
    source: Source,
    query: &[(String, String)],
    headers: &HeaderMap,
) -> Result<Response, ApiError> {
    refuse_unknown(query, &["after", "limit"])?;
    let text = |name: &str| headers.get(name).and_then(|v| v.to_str().ok()).map(str::to_owned);
    let after = number(query, "after")?;
    let limit = number(query, "limit")?.unwrap_or(PAGE.0).clamp(1, PAGE.1);
    let has_ended = source.has_ended(&application).await?;
    if text(header::ACCEPT.as_str()).is_some_and(|accept| accept.contains("text/event-stream")) {
        let last: Vec<_> = text("last-event-id").into_iter().map(|id| ("Last-Event-ID".to_owned(), id)).collect();
        let after = number(&last, "Last-Event-ID")?.or(after).unwrap_or(0);
        if has_ended && source.page(&application, after, 1).await?.is_empty() {
            return Ok(StatusCode::NO_CONTENT.into_response());
        }
        return Ok(stream(application, source, after));
    }
    let mut items = source.page(&application, after.unwrap_or(0), limit + 1).await?;
    let more = items.len() as u64 > limit;
    items.truncate(limit as usize);
    let next = items.last().filter(|_| more).map(|event| event.id);
    Ok(Json(EventList { items, next }).into_response())
}

fn stream(application: Application, source: Source, after: u64) -> Response {
    let (sender, receiver) = mpsc::channel::<Result<SseEvent, Infallible>>(QUEUE);
    tokio::spawn(async move {
        metrics::gauge!("meniscus_event_streams").increment(1.0);
        feed(application, source, after, sender).await;
        metrics::gauge!("meniscus_event_streams").decrement(1.0);
    });
    let keep_alive = KeepAlive::new().interval(Duration::from_secs(15));
    Sse::new(ReceiverStream::new(receiver)).keep_alive(keep_alive).into_response()
}

/// Sends what is there, waits for more, ends after the last event of all, with the client, or with the service. A slow
/// client holds up its own queue alone.
async fn feed(
    application: Application,
    source: Source,
    mut after: u64,
    sender: mpsc::Sender<Result<SseEvent, Infallible>>,
) {
    let mut changes = application.store.watch();
    let mut stopping = application.stopping.clone();
    loop {
        changes.mark_unchanged();
        let Ok(events) = source.page(&application, after, AT_ONCE).await else {
            return;
        };
        let is_empty = events.is_empty();
        if is_empty {
            // Beyond the last event of a job that has ended, or is gone, nothing will come.
            let ended = source.has_ended(&application).await.unwrap_or(true);
            let more = source.page(&application, after, 1).await.is_ok_and(|events| !events.is_empty());
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
            tokio::time::sleep(BREATH).await;
        }
    }
}
