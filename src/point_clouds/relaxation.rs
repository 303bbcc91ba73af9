//! Random points on a surface, and their relaxation: neighbors repel each other until they are about equally far apart.

use crate::geometry::random::CounterRandom;
use crate::geometry::{Domain, Surface, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::Interrupt;
use rayon::prelude::{IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator};

/// `count` random points on a surface in space, approximately uniform over its area.
///
/// Uniform points in a thin shell around the surface are moved to their closest points. `layer` is the half width of
/// the shell, which must be well below the radii of curvature. An interrupt ends the search with fewer points.
#[must_use]
pub fn random_points(
    surface: &dyn Surface<3>,
    count: usize,
    layer: f64,
    seed: u64,
    interrupt: &Interrupt,
) -> Vec<Vector<3>> {
    let random = CounterRandom::new(seed);
    let (low, high) = surface.bounding_box();
    let (low, high) = (low.add_scalar(-layer), high.add_scalar(layer));
    let mut found = Vec::with_capacity(count);
    let mut draw = 0_i64;
    while found.len() < count && !interrupt.is_raised() {
        let x = Vector::<3>::from_fn(|d, _| {
            let unit = 0.5 + 0.5 * random.symmetric(&[draw, d as i64]);
            low[d] + unit * (high[d] - low[d])
        });
        draw += 1;
        let nearest = surface.nearest(&x);
        if nearest.distance.abs() <= layer {
            found.push(nearest.point);
        }
    }
    found
}

/// Number of rounds of repulsion.
const ROUNDS: usize = 80;
/// Cutoff radius of the repulsion, in mean spacings.
const CUTOFF: f64 = 1.8;
/// Displacement per neighbor at zero distance, in mean spacings.
const PUSH: f64 = 0.25;

/// Relaxes points with the mean spacing δ_n = `spacing`, and projects them back onto their surface with `onto`.
///
/// A round moves point i by about 0.25 δ_n Σ_j (1 − r/ρ)² (x_i − x_j)/r over its neighbors within ρ = 1.8 δ_n. An
/// interrupt ends the relaxation early.
pub fn relax(
    points: &mut Vec<Vector<3>>,
    spacing: f64,
    onto: impl Fn(&Vector<3>) -> Vector<3> + Sync,
    interrupt: &Interrupt,
) {
    let mut cells = CellList::new(Domain::unbounded());
    let cutoff = CUTOFF * spacing;
    let mut moved = points.clone();
    for round in 0..ROUNDS {
        if interrupt.is_raised() {
            return;
        }
        cells.rebuild(points.iter().copied(), cutoff);
        // Displacements decrease toward the end, so that points come to rest.
        let push = PUSH * spacing * (1.0 - 0.8 * round as f64 / ROUNDS as f64);
        moved.par_iter_mut().with_min_len(64).enumerate().for_each(|(i, moved)| {
            let x = points[i];
            let mut shift = Vector::<3>::zeros();
            cells.for_each_within(&x, cutoff, |j, dx, square| {
                if j != i && square > 0.0 {
                    let r = square.sqrt();
                    shift -= dx * ((1.0 - r / cutoff).powi(2) / r);
                }
            });
            *moved = onto(&(x + shift * push));
        });
        std::mem::swap(points, &mut moved);
    }
}

#[cfg(test)]
mod tests {
    use super::{Interrupt, Surface, Vector, random_points, relax};
    use crate::geometry::surfaces::Torus;

    #[test]
    fn relaxed_points_keep_their_distance_and_their_surface() {
        let torus = Torus { center: Vector::<3>::zeros(), major_radius: 1.0, minor_radius: 0.4 };
        let count = 1500;
        let mut points = random_points(&torus, count, 0.02, 7, &Interrupt::default());
        let area = 4.0 * std::f64::consts::PI.powi(2) * 0.4;
        let spacing = (area / count as f64).sqrt();
        relax(&mut points, spacing, |x| torus.nearest(x).point, &Interrupt::default());
        let mut least = f64::INFINITY;
        for (i, x) in points.iter().enumerate() {
            assert!(torus.signed_distance(x).abs() < 1e-12);
            least = points[..i].iter().map(|y| (x - y).norm()).fold(least, f64::min);
        }
        assert!(least > 0.6 * spacing, "{}", least / spacing);
    }

    #[test]
    fn an_interrupt_ends_the_drawing() {
        let torus = Torus { center: Vector::<3>::zeros(), major_radius: 1.0, minor_radius: 0.4 };
        let interrupt = Interrupt::default();
        interrupt.raise();
        assert!(random_points(&torus, 1_000_000, 0.02, 7, &interrupt).is_empty());
    }
}
