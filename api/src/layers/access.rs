//! Refuses requests to unknown host names, from pages of other origins, and without the needed token or ticket.

use crate::access::tickets::{self, Tickets};
use crate::access::{AccessError, AccessRules, Client, Scope};
use crate::error::ApiError;
use crate::page;
use crate::state::AppState;
use axum::extract::{Request, State};
use axum::http::{Uri, header, uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// Name of the query parameter with a ticket.
const TICKET: &str = "ticket";

/// Lets a request pass if the access rules allow it, and attaches the [`Client`].
pub async fn check(State(state): State<AppState>, mut request: Request, next: Next) -> Response {
    let ticket = take_ticket(request.uri_mut());
    match allowed(&state.config.access.current(), &state.tickets, ticket.as_deref(), &request) {
        Ok(client) => {
            request.extensions_mut().insert(client);
            next.run(request).await
        }
        Err(error) => error.into_response(),
    }
}

/// Whether a path answers whatever the request names as its host: probes ask by address, or without a name.
fn is_probe(path: &str) -> bool {
    path == "/healthz" || path == "/readyz"
}

fn allowed(
    rules: &AccessRules,
    tickets: &Tickets,
    ticket: Option<&str>,
    request: &Request,
) -> Result<Client, ApiError> {
    let path = request.uri().path();
    let text = |name| request.headers().get(name).and_then(|value| value.to_str().ok());
    // A request line may name the host instead of the header.
    let host = request.uri().authority().map(uri::Authority::as_str).or_else(|| text(header::HOST));
    if !is_probe(path) && !host.is_some_and(|host| rules.is_known_host(host)) {
        return Err(ApiError::UnknownHost);
    }
    // A page of another origin must not create jobs through a person's browser.
    let is_own = |origin: &str| origin.split_once("://").is_some_and(|(_, host)| rules.is_known_host(host));
    if text(header::ORIGIN).is_some_and(|origin| !is_own(origin) && !rules.is_known_origin(origin)) {
        return Err(ApiError::ForeignOrigin);
    }
    // The page is where one signs in.
    if page::has(path) {
        return Ok(Client::default());
    }
    let Some(scope) = Scope::needed(request.method(), path) else { return Ok(Client::default()) };
    if scope == Scope::Read
        && tickets::opens(path)
        && let Some(ticket) = ticket
    {
        // It reads, whatever else its maker may do.
        let client = tickets.client(ticket).ok_or(ApiError::Unauthorized)?;
        return Ok(Client { is_admin: false, ..client });
    }
    rules.client(request.headers(), scope).map_err(|error| match error {
        AccessError::Unauthorized => ApiError::Unauthorized,
        AccessError::Forbidden(scope) => ApiError::Forbidden(scope.word()),
    })
}

/// Takes a ticket out of a query: no route and no log sees it.
fn take_ticket(uri: &mut Uri) -> Option<String> {
    let query = uri.query()?;
    let is_ticket = |pair: &&str| pair.split('=').next() == Some(TICKET);
    let ticket = query.split('&').find(is_ticket)?.split_once('=').map(|(_, ticket)| ticket.to_owned());
    let rest: Vec<&str> = query.split('&').filter(|pair| !is_ticket(pair)).collect();
    let target = if rest.is_empty() { uri.path().to_owned() } else { format!("{}?{}", uri.path(), rest.join("&")) };
    let mut parts = uri.clone().into_parts();
    parts.path_and_query = target.parse().ok();
    if let Ok(without) = Uri::from_parts(parts) {
        *uri = without;
    }
    ticket
}

#[cfg(test)]
mod tests {
    use super::take_ticket;
    use axum::http::Uri;

    #[test]
    fn a_ticket_is_taken_out_of_the_query() {
        for (target, ticket, rest) in [
            ("/a?ticket=mnt_1", Some("mnt_1"), "/a"),
            ("/a?after=3&ticket=mnt_1&limit=2", Some("mnt_1"), "/a?after=3&limit=2"),
            ("/a?tickets=1", None, "/a?tickets=1"),
        ] {
            let mut uri: Uri = target.parse().unwrap();
            assert_eq!(take_ticket(&mut uri).as_deref(), ticket);
            assert_eq!(uri.to_string(), rest);
        }
    }
}
