//! Tickets for event streams and downloads where no header can be sent, such as in a browser.

use crate::access::Client;
use crate::access::tickets::LIFETIME;
use crate::error::{ApiError, Problem};
use crate::state::AppState;
use crate::views::TicketView;
use axum::extract::State;
use axum::http::StatusCode;
use axum::{Extension, Json};
use meniscus_jobs::system::clock;

/// Makes a ticket: read access for a minute, as `?ticket=` of events, files and content.
#[utoipa::path(post, path = "/v1/tickets", operation_id = "make_ticket", tag = "service",
    responses((status = 201, body = TicketView), (status = 401, body = Problem)))]
pub async fn issue(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
) -> Result<(StatusCode, Json<TicketView>), ApiError> {
    let ticket = state.tickets.issue(&client)?;
    let expires_at = clock::from_now(LIFETIME.as_secs().cast_signed());
    Ok((StatusCode::CREATED, Json(TicketView { ticket, expires_at })))
}
