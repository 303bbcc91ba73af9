//! Kinds of scenes.

use crate::error::{ApiError, Problem};
use crate::path::Path;
use crate::views::{QuantityView, SceneKindList, SceneKindView};
use axum::Json;
use meniscus::scene::{Quantities, SceneKind};
use meniscus::scenes::{SCENES, find};
use meniscus::simulation::Quantity;

fn view(kind: &SceneKind) -> SceneKindView {
    let Quantities { fields, observables, norms } = (kind.quantities)();
    let declared = |list: Vec<&'static Quantity>| list.into_iter().map(QuantityView::from).collect();
    SceneKindView {
        kind: kind.kind,
        title: kind.title,
        schema: kind.json_schema(),
        presets: kind.preset_names(),
        restart_safe: kind.restart_safe(),
        fields: declared(fields),
        observables: declared(observables),
        norms: declared(norms),
        // The example is part of the program; a test runs it.
        example: serde_json::from_str(kind.example).unwrap_or_default(),
    }
}

/// All kinds of scenes with their schemas.
#[utoipa::path(get, path = "/v1/scenes", operation_id = "list_scenes", tag = "scenes", responses((status = 200, body = SceneKindList)))]
pub async fn list() -> Json<SceneKindList> {
    Json(SceneKindList::from((SCENES.iter().map(|kind| view(kind)).collect(), None)))
}

/// One kind of scene with its schema.
#[utoipa::path(get, path = "/v1/scenes/{kind}", operation_id = "get_scene", tag = "scenes", params(("kind" = String, Path)),
    responses((status = 200, body = SceneKindView), (status = 404, body = Problem)))]
pub async fn get(Path(kind): Path<String>) -> Result<Json<SceneKindView>, ApiError> {
    find(&kind).map(|kind| Json(view(kind))).ok_or(ApiError::NotFound("kind of scene"))
}
