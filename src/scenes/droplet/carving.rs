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
/// Meshes that are no closed surfaces, and bodies that do not suit the box.
pub(super) fn container_at_build<const D: usize>(
    room: &Room<D>,
    clouds: &Clouds,
) -> Result<Option<Container<D>>, Vec<Violation>> {
    let Some(container) = &room.container else { return Ok(None) };
    let (mut obstacles, mut errors) = (Vec::new(), Vec::new());
    for obstacle in &room.obstacles {
        let surface = match &obstacle.surface {
            Some(surface) => Ok(surface.whole.clone()),
            None => mesh::surface::<D>(clouds, obstacle.place),
        };
        match surface {
            Ok(surface) => {
                errors.extend(check_body(room, obstacle, surface.as_ref()));
                obstacles.push(Obstacle::new(surface, obstacle.wall.clone()));
            }
            Err(found) => errors.extend(found),
        }
    }
    if errors.is_empty() { Ok(Some(container.clone().with_obstacles(obstacles))) } else { Err(errors) }
}

/// Errors where the bodies that are known before a run do not suit the box, and where a drop that is reaches into them.
pub(super) fn check<const D: usize>(
    room: &Room<D>,
    drop: Option<(&Shape, &dyn Surface<D>)>,
    errors: &mut Vec<Violation>,
) {
    if room.obstacles.iter().any(|obstacle| obstacle.surface.is_none()) {
        let known = room.obstacles.iter().filter_map(|obstacle| Some((obstacle, obstacle.surface.as_ref()?)));
        errors.extend(known.filter_map(|(obstacle, surface)| check_body(room, obstacle, surface.whole.as_ref())));
        return;
    }
    match container_at_build(room, &Clouds::default()) {
        Ok(container) => errors.extend(drop.and_then(|drop| check_known_drop((room, container.as_ref()), drop))),
        Err(found) => errors.extend(found),
    }
}

/// The share of the box that bodies leave to the fluids, as far as they are known before a run.
pub(super) fn free_share<const D: usize>(room: &Room<D>) -> f64 {
    let known = |obstacle: &PlannedObstacle<D>| {
        let surface = obstacle.surface.as_ref()?.whole.clone();
        Some(Obstacle::new(surface, obstacle.wall.clone()))
    };
    let obstacles: Vec<Obstacle<D>> = room.obstacles.iter().filter_map(known).collect();
    let Some(container) = room.container.clone().filter(|_| !obstacles.is_empty()) else { return 1.0 };
    let container = container.with_obstacles(obstacles);
    let places = grid((room.low, room.high));
    let is_free = |x: &&Vector<D>| container.beside_obstacle(x).is_none_or(|beside| beside.distance > 0.0);
    places.iter().filter(is_free).count() as f64 / places.len() as f64
}

/// Places along an axis at which bodies are looked for, in the plane and in space.
const LOOKS: [usize; 2] = [64, 24];

const fn looks(dimension: usize) -> usize {
    LOOKS[(dimension != 2) as usize]
}

/// Places between two corners.
fn grid<const D: usize>((low, high): (Vector<D>, Vector<D>)) -> Vec<Vector<D>> {
    let looks = looks(D);
    let place = |k: usize| {
        let cell = indices(k, &[looks; D]);
        Vector::<D>::from_fn(|d, _| low[d] + (high[d] - low[d]) * (cell[d] as f64 + 0.5) / looks as f64)
    };
    (0..looks.pow(D as u32)).map(place).collect()
}

/// An error where a body lies outside of the box, across a periodic side so that its image is too near, or is so thin that particles on both
/// sides feel each other.
fn check_body<const D: usize>(
    room: &Room<D>,
    obstacle: &PlannedObstacle<D>,
    surface: &dyn Surface<D>,
) -> Option<Violation> {
    let (low, high) = surface.bounding_box();
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
    let deepest = grid((low, high)).iter().map(|x| -surface.signed_distance(x)).fold(0.0, f64::max);
    // The middle lies half of a cell from a place at most.
    let thickness = 2.0 * deepest + ((high - low) / looks(D) as f64).min();
    if thickness < room.least_layer {
        return refused(format!(
            "the obstacle is about {thickness:.4} thick; particles on its two sides feel each other up to {:.4}: make it thicker, or the \
             spacing finer",
            room.least_layer
        ));
    }
    None
}

/// An error where a drop that is known before a run reaches into bodies without a contact angle.
fn check_known_drop<const D: usize>(
    (room, container): (&Room<D>, Option<&Container<D>>),
    (shape, drop): (&Shape, &dyn Surface<D>),
) -> Option<Violation> {
    if room.obstacles.is_empty() {
        return None;
    }
    let positions = grid(drop.bounding_box());
    let level: Vec<f64> = positions.iter().map(|x| drop.signed_distance(x)).collect();
    check_drop((room, container), shape, (&positions, &level))
}

/// Moves places of the lattice that lie in bodies to those behind walls; deeper ones than `room.least_layer` are dropped. Returns all
/// that lay in bodies.
///
/// # Errors
/// Bodies that leave no fluid.
pub(super) fn carve<const D: usize>(
    room: &Room<D>,
    container: Option<&Container<D>>,
    positions: &mut Vec<Vector<D>>,
    behind_walls: &mut Vec<Vector<D>>,
) -> Result<Vec<Vector<D>>, Violation> {
    let mut carved = Vec::new();
    let Some(container) = container.filter(|container| container.has_obstacles()) else { return Ok(carved) };
    positions.retain(|x| match container.beside_obstacle(x) {
        Some(beside) if beside.distance <= 0.0 => {
            carved.push(*x);
            behind_walls.extend((-beside.distance <= room.least_layer).then_some(*x));
            false
        }
        _ => true,
    });
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
