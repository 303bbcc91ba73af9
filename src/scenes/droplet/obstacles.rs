//! Bodies that stand in the box of a scene.

use super::room::{Room, wall};
use super::spec::{ObstacleSpec, WallSpec};
use crate::geometry::block::indices;
use crate::geometry::{Surface, Vector};
use crate::scene::cloud::{CloudReference, CloudRole, Clouds};
use crate::scene::mesh;
use crate::scenes::shapes::{Shape, ShapeSurface};
use crate::schemes::weakly_compressible_sph::walls::{Container, Obstacle, Wall};
use crate::spec::{Parameter, Violation};
use serde_json::{Value, json};

/// Bodies of a scene at most: those from outside are named by their places.
pub(super) const MOST: usize = 16;

/// The places of shapes.
static PLACES: [&str; MOST] = [
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
    place: &'static str,
    shape: Shape,
    /// None of a mesh from outside.
    surface: Option<ShapeSurface<D>>,
    wall: Wall<D>,
    has_angle: bool,
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
        let wall = wall(&WallSpec { velocity: None, ..given.clone() }, 0, &format!("{at}/wall"), errors);
        let has_angle = given.has_angle();
        planned.push(PlannedObstacle { place, shape: shape.clone(), surface, wall, has_angle });
    }
    (planned, clouds)
}

/// The container of a room with its bodies, as they are known when a simulation is built.
///
/// # Errors
/// Meshes that are no closed surfaces, and bodies that the box has no room for.
pub(super) fn container_at_build<const D: usize>(
    room: &Room<D>,
    clouds: &Clouds,
) -> Result<Option<Container<D>>, Vec<Violation>> {
    let Some(container) = &room.container else { return Ok(None) };
    let (mut obstacles, mut errors) = (Vec::new(), Vec::new());
    for obstacle in &room.obstacles {
        let surface = match &obstacle.surface {
            Some(surface) => surface.whole.clone(),
            None => match mesh::surface::<D>(clouds, obstacle.place) {
                Ok(surface) => surface,
                Err(found) => {
                    errors.extend(found);
                    continue;
                }
            },
        };
        errors.extend(check_place(room, obstacle, surface.bounding_box()));
        obstacles.push(Obstacle::new(surface, obstacle.wall.clone()));
    }
    if errors.is_empty() { Ok(Some(container.clone().with_obstacles(obstacles))) } else { Err(errors) }
}

/// Errors where the bodies that are known before a run do not stand in the box.
pub(super) fn check_known<const D: usize>(room: &Room<D>) -> impl Iterator<Item = Violation> + '_ {
    room.obstacles.iter().filter_map(|obstacle| {
        let surface = obstacle.surface.as_ref()?;
        check_place(room, obstacle, surface.whole.bounding_box())
    })
}

/// An error where a body lies outside of the box, or across a periodic side so that its image is too near.
fn check_place<const D: usize>(
    room: &Room<D>,
    obstacle: &PlannedObstacle<D>,
    (low, high): (Vector<D>, Vector<D>),
) -> Option<Violation> {
    let refused = |detail: String| {
        let allowed = json!([room.low.as_slice(), room.high.as_slice()]);
        Some(Violation::new(obstacle.place, "conflict", detail, obstacle.shape.to_json(), allowed))
    };
    let is_outside = |d: usize| room.is_bounded(d) && (high[d] <= room.low[d] || low[d] >= room.high[d]);
    if (0..D).any(is_outside) {
        return refused("the obstacle lies behind a wall".to_owned());
    }
    let lengths = room.lengths();
    for d in (0..D).filter(|d| !room.is_bounded(*d)) {
        let gap = lengths[d] - (high[d] - low[d]);
        if gap > 0.0 && gap < room.least_layer {
            return refused(format!(
                "along axis {d} {gap:.4} are left between the obstacle and its image; leave {:.4} at least, or let it reach through \
                 the box",
                room.least_layer
            ));
        }
    }
    None
}

/// Places along an axis at which a drop is looked for in bodies.
const LOOKS: usize = 64;

/// An error where a drop that is known before a run reaches into bodies that are, and have no contact angle.
pub(super) fn check_known_drop<const D: usize>(
    room: &Room<D>,
    (shape, drop): (&Shape, &dyn Surface<D>),
) -> Option<Violation> {
    if room.obstacles.is_empty() || room.obstacles.iter().any(|obstacle| obstacle.surface.is_none()) {
        return None;
    }
    let container = container_at_build(room, &Clouds::default()).ok()?;
    let (low, high) = drop.bounding_box();
    let place = |k: usize| {
        let cell = indices(k, &[LOOKS; D]);
        Vector::<D>::from_fn(|d, _| low[d] + (high[d] - low[d]) * (cell[d] as f64 + 0.5) / LOOKS as f64)
    };
    let positions: Vec<Vector<D>> = (0..LOOKS.pow(D as u32)).map(place).collect();
    let level: Vec<f64> = positions.iter().map(|x| drop.signed_distance(x)).collect();
    check_drop((room, container.as_ref()), shape, (&positions, &level))
}

/// Moves places of the lattice that lie in bodies to those behind walls; deeper ones than `room.least_layer` are dropped. Returns all
/// that lay in bodies.
///
/// # Errors
/// A body that is so thin that particles on both sides feel each other, and one that leaves no fluid.
pub(super) fn carve<const D: usize>(
    room: &Room<D>,
    container: Option<&Container<D>>,
    positions: &mut Vec<Vector<D>>,
    behind_walls: &mut Vec<Vector<D>>,
) -> Result<Vec<Vector<D>>, Violation> {
    let mut carved = Vec::new();
    let Some(container) = container.filter(|container| container.has_obstacles()) else { return Ok(carved) };
    let mut deepest = vec![0.0_f64; room.obstacles.len()];
    let mut fluid = Vec::with_capacity(positions.len());
    for x in positions.iter() {
        match container.beside_obstacle(x) {
            Some(beside) if beside.distance <= 0.0 => {
                let deepest = &mut deepest[beside.wall - 2 * D];
                *deepest = deepest.max(-beside.distance);
                carved.push(*x);
                if -beside.distance <= room.least_layer {
                    behind_walls.push(*x);
                }
            }
            _ => fluid.push(*x),
        }
    }
    *positions = fluid;
    for (obstacle, deepest) in room.obstacles.iter().zip(deepest) {
        let thickness = 2.0 * deepest + room.spacing;
        if thickness < room.least_layer {
            let detail = format!(
                "the obstacle is about {thickness:.4} thick; particles on its two sides feel each other up to {:.4}: make it thicker, \
                 or the spacing finer",
                room.least_layer
            );
            return Err(Violation::new(obstacle.place, "range", detail, obstacle.shape.to_json(), room.least_layer));
        }
    }
    if positions.is_empty() {
        let detail = "the obstacles leave no room for the fluids";
        return Err(Violation::new("/obstacles", "conflict", detail, Value::Null, Value::Null));
    }
    Ok(carved)
}

/// Errors where the drop reaches into bodies without a contact angle; `level` tells its signed distances.
pub(super) fn check_drop<const D: usize>(
    (room, container): (&Room<D>, Option<&Container<D>>),
    shape: &Shape,
    (positions, level): (&[Vector<D>], &[f64]),
) -> Option<Violation> {
    let container = container.filter(|container| container.has_obstacles() && room.needs_angles)?;
    // A layer reaches through whatever stands in it.
    if let Shape::Layer { .. } = shape {
        return None;
    }
    let mut depths = vec![0.0_f64; room.obstacles.len()];
    for (x, level) in positions.iter().zip(level) {
        if let Some(beside) = container.beside_obstacle(x).filter(|_| *level < 0.0) {
            let depth = &mut depths[beside.wall - 2 * D];
            *depth = depth.max((-beside.distance).min(-level));
        }
    }
    let (obstacle, depth) =
        room.obstacles.iter().zip(depths).find(|(obstacle, depth)| !obstacle.has_angle && *depth > 0.0)?;
    let detail = format!(
        "the drop reaches {depth:.4} into the obstacle {}; give its wall a contact_angle, so that the drop sits on it, or move the drop",
        obstacle.place.trim_end_matches("/shape")
    );
    Some(Violation::new("/shape", "conflict", detail, shape.to_json(), Value::Null))
}
