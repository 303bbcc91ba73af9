//! Bodies in the box of a scene: where they may stand, and the places of the lattice that they take.

use super::obstacles::PlannedObstacle;
use super::room::Room;
use crate::geometry::block::indices;
use crate::geometry::{Surface, Vector};
use crate::scene::cloud::Clouds;
use crate::scene::mesh;
use crate::scenes::shapes::Shape;
use crate::schemes::weakly_compressible_sph::walls::{Container, Obstacle};
use crate::spec::{Parameter, Violation};
use serde_json::{Value, json};

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

/// Errors where the bodies that are known before a run do not stand in the box, and where a drop that is reaches into them.
pub(super) fn check<const D: usize>(
    room: &Room<D>,
    drop: Option<(&Shape, &dyn Surface<D>)>,
    errors: &mut Vec<Violation>,
) {
    errors.extend(room.obstacles.iter().filter_map(|obstacle| {
        let surface = obstacle.surface.as_ref()?;
        check_place(room, obstacle, surface.whole.bounding_box())
    }));
    errors.extend(drop.and_then(|drop| check_known_drop(room, drop)));
}

/// The share of the box that bodies leave to the fluids, as far as they are known before a run.
pub(super) fn free_share<const D: usize>(room: &Room<D>) -> f64 {
    let known = || room.obstacles.iter().filter_map(|obstacle| obstacle.surface.as_ref());
    let obstacles = known().map(|surface| Obstacle::new(surface.whole.clone(), room.obstacles[0].wall.clone()));
    let obstacles: Vec<Obstacle<D>> = obstacles.collect();
    let Some(container) = room.container.clone().filter(|_| !obstacles.is_empty()) else { return 1.0 };
    let container = container.with_obstacles(obstacles);
    let places = grid((room.low, room.high));
    let is_free = |x: &&Vector<D>| container.beside_obstacle(x).is_none_or(|beside| beside.distance > 0.0);
    places.iter().filter(is_free).count() as f64 / places.len() as f64
}

/// Places between two corners.
fn grid<const D: usize>((low, high): (Vector<D>, Vector<D>)) -> Vec<Vector<D>> {
    let place = |k: usize| {
        let cell = indices(k, &[LOOKS; D]);
        Vector::<D>::from_fn(|d, _| low[d] + (high[d] - low[d]) * (cell[d] as f64 + 0.5) / LOOKS as f64)
    };
    (0..LOOKS.pow(D as u32)).map(place).collect()
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

/// Places along an axis at which bodies are looked for.
const LOOKS: usize = 64;

/// An error where a drop that is known before a run reaches into bodies that are, and have no contact angle.
fn check_known_drop<const D: usize>(room: &Room<D>, (shape, drop): (&Shape, &dyn Surface<D>)) -> Option<Violation> {
    if room.obstacles.is_empty() || room.obstacles.iter().any(|obstacle| obstacle.surface.is_none()) {
        return None;
    }
    let container = container_at_build(room, &Clouds::default()).ok()?;
    let positions = grid(drop.bounding_box());
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
