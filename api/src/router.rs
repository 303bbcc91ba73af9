//! Every route, and the layers that every request passes through.

use crate::base_path;
use crate::error::ApiError;
use crate::layers::encoding::IsText;
use crate::layers::{access, encoding, readiness, request_id, request_log, security_headers};
use crate::openapi::{self, Document};
use crate::page;
use crate::routes::{
    checkpoints, estimates, events, files, job_changes, jobs, metrics, problems, results, scenes, service, studies,
    tickets, uploads,
};
use crate::state::AppState;
use axum::Router;
use axum::body::Bytes;
use axum::extract::Request;
use axum::http::request::Parts;
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::{from_fn, from_fn_with_state};
use axum::response::IntoResponse;
use std::time::Duration;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::cors::{AllowHeaders, AllowOrigin, CorsLayer};
use tower_http::decompression::RequestDecompressionLayer;
use tower_http::timeout::RequestBodyTimeoutLayer;
use tower_service::Service;
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
        .routes(routes!(job_changes::act))
        .routes(routes!(jobs::get, jobs::delete, job_changes::change))
        .routes(routes!(job_changes::retry))
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
        .routes(routes!(tickets::issue))
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

/// The whole service, below its base path. A request passes the layers from the last line to the first.
pub fn router(state: AppState) -> Router {
    let (routes, document) = documented().split_for_parts();
    // Serialized once, since every request would clone the document.
    let document = Bytes::from(openapi::complete(openapi::publish(document)).to_string());
    let document = ([(header::CONTENT_TYPE, "application/json")], document);
    let routes = routes
        .route("/openapi.json", axum::routing::get(move || async move { document }))
        .fallback(page::get)
        .method_not_allowed_fallback(|| async { ApiError::MethodNotAllowed })
        .layer(from_fn_with_state(state.clone(), readiness::check))
        .layer(from_fn_with_state(state.clone(), access::check))
        .layer(RequestBodyTimeoutLayer::new(BODY_PAUSE))
        .layer(RequestDecompressionLayer::new().gzip(true).pass_through_unaccepted(true))
        .layer(from_fn(encoding::check))
        .layer(cors(&state))
        .layer(CompressionLayer::new().gzip(true).compress_when(IsText))
        .layer(CatchPanicLayer::custom(|_| ApiError::Internal("a handler panicked".to_owned()).into_response()))
        .layer(from_fn(request_log::record))
        .layer(from_fn(security_headers::add))
        .layer(from_fn(request_id::attach))
        .with_state(state.clone());
    if base_path::get().is_empty() {
        return routes;
    }
    // The folder itself is the page.
    let whole = routes.clone();
    let folder = move |request: Request| Service::call(&mut whole.clone(), request);
    // Probes come without the proxy and do not know its path.
    Router::new()
        .route("/healthz", axum::routing::get(service::health))
        .route("/readyz", axum::routing::get(service::ready))
        .with_state(state)
        .route(&format!("{}/", base_path::get()), axum::routing::any(folder))
        .nest(base_path::get(), routes)
        .fallback(|| async { ApiError::NotFound("resource; the service answers below its base path") })
}

/// Longest pause within the body of a request.
const BODY_PAUSE: Duration = Duration::from_secs(30);
/// Time for which a browser remembers what it may send.
const CORS_MEMORY: Duration = Duration::from_secs(3600);

/// Lets pages of the origins that the operator allows read answers.
fn cors(state: &AppState) -> CorsLayer {
    let access = state.config.access.clone();
    let is_allowed = move |origin: &HeaderValue, _: &Parts| {
        origin.to_str().is_ok_and(|origin| access.current().is_known_origin(origin))
    };
    let exposed = [
        header::ETAG,
        header::LOCATION,
        header::LINK,
        header::RETRY_AFTER,
        header::CONTENT_RANGE,
        header::CONTENT_DISPOSITION,
        HeaderName::from_static("x-request-id"),
        HeaderName::from_static("repr-digest"),
        HeaderName::from_static("idempotent-replayed"),
    ];
    CorsLayer::new()
        .allow_origin(AllowOrigin::predicate(is_allowed))
        .allow_methods([Method::GET, Method::HEAD, Method::POST, Method::PATCH, Method::DELETE])
        .allow_headers(AllowHeaders::mirror_request())
        .expose_headers(exposed)
        .max_age(CORS_MEMORY)
}

#[cfg(test)]
mod tests {
    use super::documented;
    use crate::openapi::{complete, publish};
    use serde_json::Value;
    use std::collections::HashSet;

    fn document() -> Value {
        complete(publish(documented().split_for_parts().1))
    }

    fn operations(document: &Value) -> Vec<(String, &Value)> {
        let paths = document["paths"].as_object().unwrap();
        let of = |(path, item): (&String, &'_ Value)| (path.clone(), item.as_object().unwrap().len());
        assert!(paths.iter().map(of).all(|(_, methods)| methods > 0));
        paths
            .iter()
            .flat_map(|(path, item)| {
                item.as_object().unwrap().iter().map(move |(method, operation)| (format!("{method} {path}"), operation))
            })
            .collect()
    }

    #[test]
    fn the_document_is_openapi_31_and_names_every_schema_it_uses() {
        let json = document();
        assert!(json["paths"]["/v1/jobs/{id}/files/{path}"]["get"].is_object());
        assert!(json["openapi"].as_str().unwrap().starts_with("3.1"));
        let text = json.to_string();
        for reference in text.split("\"#/components/schemas/").skip(1) {
            let name = reference.split('"').next().unwrap();
            assert!(json["components"]["schemas"].get(name).is_some(), "{name}");
        }
        assert!(json["paths"]["/v1/jobs"]["post"]["responses"]["422"].is_object());
    }
    #[test]
    fn every_operation_has_an_id_of_its_own_and_describes_its_responses() {
        let document = document();
        let mut ids = HashSet::new();
        for (name, operation) in operations(&document) {
            assert!(ids.insert(operation["operationId"].as_str().unwrap()), "{name}");
            for (status, response) in operation["responses"].as_object().unwrap() {
                assert!(!response["description"].as_str().unwrap().is_empty(), "{name} {status}");
            }
        }
    }

    #[test]
    fn bodies_are_the_schemas_of_the_scenes() {
        let document = document();
        let body = |path: &str| document["paths"][path]["post"]["requestBody"]["content"]["application/json"].clone();
        assert_eq!(body("/v1/jobs")["schema"]["$ref"], "#/components/schemas/JobSpec");
        assert_eq!(body("/v1/studies")["schema"]["$ref"], "#/components/schemas/StudySpec");
        assert!(body("/v1/jobs")["examples"]["vortex"]["value"]["scene"]["kind"] == "vortex");
        let kinds = document["components"]["schemas"]["Scene"]["oneOf"].as_array().unwrap();
        assert_eq!(kinds.len(), meniscus::scenes::SCENES.len());
        let vortex = &document["components"]["schemas"]["VortexScene"]["properties"];
        assert_eq!((&vortex["kind"]["const"], &vortex["spacing"]["default"]), (&"vortex".into(), &0.015_625.into()));
    }

    #[test]
    fn streams_files_and_tokens_are_described() {
        let document = document();
        let content = |path: &str| document["paths"][path]["get"]["responses"]["200"]["content"].clone();
        assert!(content("/v1/jobs/{id}/events")["text/event-stream"].is_object());
        assert!(content("/v1/jobs/{id}/files.tar")["application/x-tar"].is_object());
        assert!(content("/v1/checkpoints/{id}/content")["application/x-hdf5"].is_object());
        assert_eq!(document["components"]["securitySchemes"]["token"]["scheme"], "bearer");
    }
}
