//! The events of a job: pages of JSON, or a stream (SSE).

use crate::application::Application;
use crate::error::{ApiError, Problem, ProblemItem};
use crate::routes::{job, with_store};
use crate::views::{EventList, EventView};
use axum::Json;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::sse::{Event as SseEvent, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use meniscus::scene::Violation;
use meniscus_jobs::job::State as JobState;
use meniscus_jobs::store::Event;
use serde_json::json;
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

/// Events on a page when nothing is said, and at most.
const PAGE: (u64, u64) = (100, 1000);
/// Events on their way to one client; a slower one waits for itself.
const QUEUE: usize = 64;

/// Events after a number: a JSON page, or with `Accept: text/event-stream` a stream that goes on until the job ends.
#[utoipa::path(get, path = "/v1/jobs/{id}/events", tag = "events",
    params(("id" = String, Path), ("after" = Option<u64>, Query), ("limit" = Option<u64>, Query),
        ("Last-Event-ID" = Option<u64>, Header)),
    responses((status = 200, body = EventList), (status = 204, description = "a stream with nothing more to come"),
        (status = 404, body = Problem), (status = 422, body = Problem)))]
pub async fn events(
    State(application): State<Application>,
    Path(id): Path<String>,
    Query(query): Query<BTreeMap<String, String>>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let text = |name: &str| headers.get(name).and_then(|v| v.to_str().ok()).map(str::to_owned);
    let after = number("after", query.get("after"))?;
    let limit = number("limit", query.get("limit"))?.unwrap_or(PAGE.0).clamp(1, PAGE.1);
    let row = job(&application, &id).await?;
    if text(header::ACCEPT.as_str()).is_some_and(|accept| accept.contains("text/event-stream")) {
        let last = number("Last-Event-ID", text("last-event-id").as_ref())?;
        let after = last.or(after).unwrap_or(0);
        if row.state.is_terminal() && page(&application, &id, after, 1).await?.is_empty() {
            return Ok(StatusCode::NO_CONTENT.into_response());
        }
        return Ok(stream(application, id, after));
    }
    let events = page(&application, &id, after.unwrap_or(0), limit + 1).await?;
    let more = events.len() as u64 > limit;
    let items: Vec<EventView> = events.into_iter().take(limit as usize).map(EventView::from).collect();
    let next = items.last().filter(|_| more).map(|event| event.id);
    Ok(Json(EventList { items, next }).into_response())
}

fn number(name: &str, text: Option<&String>) -> Result<Option<u64>, ApiError> {
    text.map(|text| {
        text.trim().parse::<u64>().map_err(|_| {
            let violation =
                Violation::new(name, "type", "a whole number is needed", &json!(text), json!("a whole number ≥ 0"));
            ApiError::Invalid(vec![ProblemItem::from(violation)])
        })
    })
    .transpose()
}

async fn page(application: &Application, id: &str, after: u64, limit: u64) -> Result<Vec<Event>, ApiError> {
    let id = id.to_owned();
    with_store(application, move |store| Ok(store.events(&id, after, limit)?)).await
}

fn stream(application: Application, id: String, after: u64) -> Response {
    let (sender, receiver) = mpsc::channel::<Result<SseEvent, Infallible>>(QUEUE);
    tokio::spawn(feed(application, id, after, sender));
    let keep_alive = KeepAlive::new().interval(Duration::from_secs(15));
    Sse::new(ReceiverStream::new(receiver)).keep_alive(keep_alive).into_response()
}

/// Sends what is there, waits for more, ends after the terminal event, with the client, or with the service.
async fn feed(
    application: Application,
    id: String,
    mut after: u64,
    sender: mpsc::Sender<Result<SseEvent, Infallible>>,
) {
    let mut changes = application.store.watch();
    let mut stopping = application.stopping.clone();
    loop {
        changes.mark_unchanged();
        let Ok(events) = page(&application, &id, after, PAGE.1).await else {
            return;
        };
        let is_empty = events.is_empty();
        if is_empty {
            // Beyond the last event of a job that has ended, or is gone, nothing will come.
            let ended = job(&application, &id).await.map_or(true, |row| row.state.is_terminal());
            let more = page(&application, &id, after, 1).await.is_ok_and(|events| !events.is_empty());
            if ended && !more {
                return;
            }
        }
        for event in events {
            after = event.id;
            let ends = event.kind == "state"
                && event.data["to"].as_str().and_then(JobState::from_word).is_some_and(JobState::is_terminal);
            let kind = event.kind.clone();
            let Ok(message) =
                SseEvent::default().id(event.id.to_string()).event(kind).json_data(EventView::from(event))
            else {
                return;
            };
            if sender.send(Ok(message)).await.is_err() || ends {
                return;
            }
        }
        if is_empty {
            tokio::select! {
                _ = changes.changed() => {}
                _ = stopping.wait_for(|stopped| *stopped) => return,
                () = sender.closed() => return,
            }
        }
    }
}
