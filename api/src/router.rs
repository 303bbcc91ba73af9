//! Every route, and the layers that every request passes through.

use crate::error::ApiError;
use crate::layers::{access, readiness, request_id, request_log, security_headers};
use crate::openapi::{self, Document};
use crate::routes::{
    checkpoints, estimates, events, files, jobs, metrics, problems, results, scenes, service, studies, uploads,
};
use crate::state::AppState;
use axum::Router;
use axum::body::Bytes;
use axum::http::header;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::response::IntoResponse;
use tower_http::catch_panic::CatchPanicLayer;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// The routes and the document that describes them.
fn documented() -> OpenApiRouter<AppState> {
    OpenApiRouter::with_openapi(Document::openapi())
        .routes(routes!(service::index))
        .routes(routes!(service::health))
        .routes(routes!(service::ready))
        .routes(routes!(metrics::metrics))
        .routes(routes!(problems::get))
        .routes(routes!(scenes::list))
        .routes(routes!(scenes::get))
        .routes(routes!(estimates::estimate))
        .routes(routes!(jobs::submit, jobs::list))
        .routes(routes!(jobs::get, jobs::delete))
        .routes(routes!(jobs::cancel))
        .routes(routes!(jobs::pause))
        .routes(routes!(jobs::resume))
        .routes(routes!(events::events))
        .routes(routes!(results::log))
        .routes(routes!(results::series))
        .routes(routes!(results::report))
        .routes(routes!(files::list))
        .routes(routes!(files::tar))
        .routes(routes!(files::get))
        .routes(routes!(checkpoints::list, checkpoints::request))
        .routes(routes!(checkpoints::latest))
        .routes(routes!(checkpoints::get, checkpoints::delete))
        .routes(routes!(checkpoints::content))
        .routes(routes!(uploads::submit, uploads::list))
        .routes(routes!(uploads::get, uploads::delete))
        .routes(routes!(studies::submit, studies::list))
        .routes(routes!(studies::get, studies::delete))
        .routes(routes!(studies::jobs_of))
        .routes(routes!(events::of_study))
        .routes(routes!(studies::table))
        .routes(routes!(studies::report))
        .routes(routes!(studies::cancel))
        .routes(routes!(studies::pause))
        .routes(routes!(studies::resume))
        .routes(routes!(studies::retry))
}

/// The whole service. A request passes the layers from the last line to the first.
pub fn router(state: AppState) -> Router {
    let (routes, document) = documented().split_for_parts();
    // Serialized once, since every request would clone the document.
    let document = Bytes::from(openapi::publish(document).to_json().unwrap_or_default());
    let document = ([(header::CONTENT_TYPE, "application/json")], document);
    routes
        .route("/openapi.json", axum::routing::get(move || async move { document }))
        .fallback(|| async { ApiError::NotFound("resource") })
        .method_not_allowed_fallback(|| async { ApiError::MethodNotAllowed })
        .layer(from_fn_with_state(state.clone(), readiness::check))
        .layer(from_fn_with_state(state.clone(), access::check))
        .layer(CatchPanicLayer::custom(|_| ApiError::Internal("a handler panicked".to_owned()).into_response()))
        .layer(from_fn(request_log::record))
        .layer(from_fn(security_headers::add))
        .layer(from_fn(request_id::attach))
        .with_state(state)
}

#[cfg(test)]
mod tests {
    use super::documented;
    use crate::openapi::publish;

    #[test]
    fn the_document_is_openapi_31_and_names_every_schema_it_uses() {
        let (_, document) = documented().split_for_parts();
        let json = serde_json::to_value(publish(document)).unwrap();
        assert!(json["paths"]["/v1/jobs/{id}/files/{path}"]["get"].is_object());
        assert!(json["openapi"].as_str().unwrap().starts_with("3.1"));
        let text = json.to_string();
        for reference in text.split("\"#/components/schemas/").skip(1) {
            let name = reference.split('"').next().unwrap();
            assert!(json["components"]["schemas"].get(name).is_some(), "{name}");
        }
        assert!(json["paths"]["/v1/jobs"]["post"]["responses"]["422"].is_object());
    }
}
