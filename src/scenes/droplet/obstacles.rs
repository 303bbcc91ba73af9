//! Bodies that stand in the box of a scene, as parameters.

use super::given_wall::wall_at_rest;
use super::spec::{MOST_OBSTACLES, ObstacleSpec};
use crate::scene::cloud::{CloudReference, CloudRole};
use crate::scenes::shapes::{Shape, ShapeSurface};
use crate::schemes::weakly_compressible_sph::walls::Wall;
use crate::spec::{Parameter, Violation};
use serde_json::json;

/// The places of shapes, by which meshes from outside are asked for.
static PLACES: [&str; MOST_OBSTACLES] = [
    "/obstacles/0/shape",
    "/obstacles/1/shape",
    "/obstacles/2/shape",
    "/obstacles/3/shape",
    "/obstacles/4/shape",
    "/obstacles/5/shape",
    "/obstacles/6/shape",
    "/obstacles/7/shape",
    "/obstacles/8/shape",
    "/obstacles/9/shape",
    "/obstacles/10/shape",
    "/obstacles/11/shape",
    "/obstacles/12/shape",
    "/obstacles/13/shape",
    "/obstacles/14/shape",
    "/obstacles/15/shape",
];

/// A body as it was given.
#[derive(Clone)]
pub(super) struct PlannedObstacle<const D: usize> {
    pub place: &'static str,
    pub shape: Shape,
    /// None of a mesh from outside.
    pub surface: Option<ShapeSurface<D>>,
    pub wall: Wall<D>,
    pub has_angle: bool,
}

/// The bodies of a scene, and the meshes that they name.
pub(super) fn plan<const D: usize>(
    specs: &[ObstacleSpec],
    errors: &mut Vec<Violation>,
) -> (Vec<PlannedObstacle<D>>, Vec<CloudReference>) {
    let (mut planned, mut clouds) = (Vec::new(), Vec::new());
    for (place, ObstacleSpec { shape, wall: given }) in PLACES.into_iter().zip(specs) {
        let at = place.trim_end_matches("/shape");
        let surface = match shape {
            Shape::Mesh { source } => {
                clouds.extend(source.reference(place, CloudRole::Mesh, errors));
                None
            }
            Shape::Points { .. } | Shape::Layer { .. } => {
                let detail = "an obstacle is a body: a shape that is known exactly, or a mesh";
                errors.push(Violation::new(place, "conflict", detail, shape.to_json(), json!({"type": "circle"})));
                continue;
            }
            Shape::Known(_) => match shape.surface::<D>(place) {
                Ok(surface) => Some(surface),
                Err(found) => {
                    errors.extend(found);
                    continue;
                }
            },
        };
        if given.velocity.as_ref().is_some_and(|velocity| velocity.iter().any(|part| *part != 0.0)) {
            let detail = "an obstacle stands still";
            let got = given.velocity.to_json();
            errors.push(Violation::new(format!("{at}/wall/velocity"), "range", detail, got, json!(vec![0.0; D])));
        }
        let wall = wall_at_rest(given, &format!("{at}/wall"), errors);
        let has_angle = given.has_angle();
        planned.push(PlannedObstacle { place, shape: shape.clone(), surface, wall, has_angle });
    }
    (planned, clouds)
}
