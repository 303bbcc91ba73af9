//! The level of an interface behind a wall: fits next to a contact line then have points on all sides.
//!
//! In front of the wall the interface is taken for a circle, in space for a sphere, of a curvature κ. Its signed distance ψ obeys
//!
//! ψ + κψ²/2 = c + n·x + κ|x|²/2,
//!
//! with x from the foot of a point, or from the point itself where no particle is near that. That is linear in c, n and κ, which are fitted to the level of the particles around the foot; with
//! κ = 0 it is a plane. (A quadratic polynomial, four spacings away from its particles, has curvatures that are wrong by a third; with
//! those a drop on a wall does not come to rest. With the curvature of the drop at rest a drop that spreads loses its area.)

use super::{Around, Point, Walls};
use crate::geometry::Vector;
use nalgebra::{SMatrix, SVector};
use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};

/// Coefficients of the fit in space; in the plane the last is not used.
const COEFFICIENTS: usize = 5;
/// Particles to a coefficient at least.
const PARTICLES: usize = 2;
/// The largest curvature, by the inverse radius of the weights.
const LARGEST_CURVATURE: f64 = 1.0;

/// The largest root mean square, by the radius, that a fit may leave: half way between two interfaces the level has a ridge, and no
/// circle follows it.
const LARGEST_REST: f64 = 5e-3;

/// What is known of particles for the continuation.
#[derive(Clone, Copy)]
pub struct Levels<'a, const D: usize> {
    pub positions: &'a [Vector<D>],
    /// The level that they carry.
    pub level: &'a [f64],
    /// Distance from the interface within which the level is continued.
    pub reach: f64,
}

impl<const D: usize> Walls<D> {
    /// Continues the level behind the walls.
    pub fn extend_level(&mut self, levels: Levels<'_, D>) {
        let Self { points, near, origins, neighbors, begins, extension, domain, radius, .. } = self;
        let found: Vec<Option<(Vector<D>, f64, Vector<D>)>> = (0..points.len())
            .into_par_iter()
            .with_min_len(64)
            .map(|k| {
                let around = Around { domain, radius: *radius, positions: levels.positions, near };
                continued((&points[k], &origins[k]), &neighbors[begins[k]..begins[k + 1]], around, levels)
            })
            .collect();
        extension.positions.clear();
        extension.level.clear();
        extension.normals.clear();
        for (position, level, normal) in found.into_iter().flatten() {
            extension.positions.push(position);
            extension.level.push(level);
            extension.normals.push(normal);
        }
    }
}

/// The level at a point behind a wall and its direction; None far from any interface.
fn continued<const D: usize>(
    (point, origin): (&Point<D>, &Vector<D>),
    neighbors: &[u32],
    around: Around<'_, D>,
    levels: Levels<'_, D>,
) -> Option<(Vector<D>, f64, Vector<D>)> {
    let level_of = |k: u32| levels.level[around.near[k as usize]];
    let least = neighbors.iter().map(|k| level_of(*k).abs()).fold(f64::INFINITY, f64::min);
    if least > levels.reach {
        return None;
    }
    let Circle { level, slope, curvature } = fit_circle(origin, neighbors, around, (level_of, levels.reach))?;
    let way = point.way_from(origin) / around.radius;
    let right = level + slope.dot(&way) + 0.5 * curvature * way.norm_squared();
    // The root next to 0, as it is without curvature.
    let found = 2.0 * right / (1.0 + (1.0 + 2.0 * curvature * right).max(0.0).sqrt()) * around.radius;
    let normal = (slope + way * curvature).try_normalize(0.0)?;
    (found.abs() <= levels.reach).then_some((point.position, found, normal))
}

/// A circle or sphere, lengths in units of the radius of the weights: c, n and κ.
struct Circle<const D: usize> {
    level: f64,
    slope: Vector<D>,
    curvature: f64,
}

fn fit_circle<const D: usize>(
    origin: &Vector<D>,
    neighbors: &[u32],
    around: Around<'_, D>,
    (level_of, reach): (impl Fn(u32) -> f64, f64),
) -> Option<Circle<D>> {
    let mut matrix = SMatrix::<f64, COEFFICIENTS, COEFFICIENTS>::zeros();
    let mut right = SVector::<f64, COEFFICIENTS>::zeros();
    let (mut count, mut squares) = (0, 0.0);
    // Levels beyond are old.
    for k in neighbors.iter().filter(|k| level_of(**k).abs() <= reach) {
        let way = around.way(origin, *k as usize);
        let (_, weight) = around.weight(&way);
        let (way, psi) = (way / around.radius, level_of(*k) / around.radius);
        count += usize::from(weight > 0.0);
        let mut row = SVector::<f64, COEFFICIENTS>::zeros();
        row[0] = 1.0;
        row[1] = 0.5 * (way.norm_squared() - psi * psi);
        for d in 0..D {
            row[2 + d] = way[d];
        }
        matrix += row * row.transpose() * weight;
        right += row * (weight * psi);
        squares += weight * psi * psi;
    }
    if count < PARTICLES * (D + 2) {
        return None;
    }
    for k in D + 2..COEFFICIENTS {
        matrix[(k, k)] = 1.0;
    }
    let all = matrix[(0, 0)];
    let found = matrix.cholesky()?.solve(&right);
    // The mean square of what the fit leaves.
    let left = ((squares - found.dot(&right)) / all).max(0.0);
    let slope = Vector::<D>::from_fn(|d, _| found[2 + d]);
    let is_one = left.sqrt() <= LARGEST_REST && found[1].abs() <= LARGEST_CURVATURE;
    let is_sound = is_one && found.iter().all(|value| value.is_finite());
    is_sound.then_some(Circle { level: found[0], slope, curvature: found[1] })
}
