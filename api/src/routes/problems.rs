//! Explanations of the types of problems.

use crate::error::{ApiError, Problem};
use crate::path::Path;
use crate::problems::ProblemType;

/// What a type of problem means and what to do about it, as plain text. `type` of a problem points here.
#[utoipa::path(get, path = "/problems/{kind}", operation_id = "explain_problem", tag = "service", params(("kind" = String, Path)),
    responses((status = 200, content_type = "text/plain"), (status = 404, body = Problem)))]
pub async fn get(Path(kind): Path<String>) -> Result<String, ApiError> {
    ProblemType::find(&kind).map(ProblemType::text).ok_or(ApiError::NotFound("type of problem"))
}
