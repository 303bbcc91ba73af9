//! The OpenAPI document as clients read it.

use crate::error::Problem;
use utoipa::ToSchema;
use utoipa::openapi::path::{Operation, PathItem};
use utoipa::openapi::{Content, OpenApi, Ref, RefOr, Response};

/// Title and description of the document.
#[derive(utoipa::OpenApi)]
#[openapi(info(
    title = "Meniscus",
    description = "Jobs for moving interfaces and the physics on them. Errors are application/problem+json (RFC 9457)."
))]
pub struct Document;

/// Problems that any request can lead to.
const ANYWHERE: [(&str, &str); 6] = [
    ("400", "The path, the query or the body cannot be read."),
    ("401", "A token is needed."),
    ("403", "The token does not allow this, or a page of another origin sent the request."),
    ("421", "The service does not answer under this host name."),
    ("500", "The service failed."),
    ("503", "The service is starting or stopping."),
];

mod completion;

pub use completion::complete;

/// Completes the document that the routes describe. The wildcard `{*path}` of the router becomes the parameter `{path}`,
/// problems get their own media type, and every operation gets the problems that any request can lead to.
#[must_use]
pub fn publish(mut document: OpenApi) -> OpenApi {
    let paths = std::mem::take(&mut document.paths.paths);
    document.paths.paths = paths.into_iter().map(|(path, item)| (path.replace("{*", "{"), item)).collect();
    for operation in document.paths.paths.values_mut().flat_map(operations) {
        let responses = &mut operation.responses.responses;
        for (status, description) in ANYWHERE {
            responses.entry(status.to_owned()).or_insert_with(|| problem_response(description).into());
        }
        for response in responses.values_mut() {
            if let RefOr::T(response) = response {
                use_problem_media_type(response);
            }
        }
    }
    document
}

fn operations(item: &mut PathItem) -> impl Iterator<Item = &mut Operation> {
    let PathItem { get, put, post, delete, options, head, patch, trace, .. } = item;
    [get, put, post, delete, options, head, patch, trace].into_iter().flatten()
}

/// Media type of answers that are no problems.
const JSON: &str = "application/json";

fn problem_content() -> Content {
    Content::new(Some(Ref::from_schema_name(Problem::name())))
}

fn problem_response(description: &str) -> Response {
    let mut response = Response::new(description);
    response.content.insert("application/problem+json".to_owned(), problem_content().into());
    response
}

fn use_problem_media_type(response: &mut Response) {
    let problem: RefOr<Content> = problem_content().into();
    if response.content.get(JSON) == Some(&problem) {
        response.content.clear();
        response.content.insert("application/problem+json".to_owned(), problem);
    }
}
