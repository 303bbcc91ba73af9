//! How many particles a band will hold and what memory they take, before they are made.

use crate::closest_point::PcpMethod;
use crate::closest_point::method::NeighborhoodChoice;
use crate::geometry::{Surface, Vector};
use crate::polynomials::multi_index::term_count;
use crate::scene::Violation;
use serde_json::json;

/// Sample points at most.
const MOST_SAMPLES: f64 = 2e5;
/// Nodes of a lattice along one axis at most: far beyond any memory, far below what indices can count.
const MOST_NODES: f64 = 1e9;

/// A violation where a band cannot be laid out on a lattice of spacing h at all.
#[must_use]
pub fn check_extent<const D: usize>(surface: &dyn Surface<D>, reach: f64, spacing: f64) -> Option<Violation> {
    let (low, high) = surface.bounding_box();
    let farthest = low.abs().sup(&high.abs()).max() + reach + spacing;
    let nodes = farthest / spacing;
    if (1.0..=MOST_NODES).contains(&nodes) {
        return None;
    }
    let detail =
        "the shape and its band are too large, too far from the origin or too fine for a lattice of this spacing";
    let allowed = json!(format!("a number ≥ {:e}", farthest / MOST_NODES));
    Some(Violation::new("/spacing", "range", detail, &json!(spacing), allowed))
}

/// Particles of spacing h within `reach` of a surface: counted on the lattice itself where that is small, else on a
/// coarser one. A band thinner than that one is widened for the count, since its measure is linear in its width.
#[must_use]
pub fn band_particles<const D: usize>(surface: &dyn Surface<D>, reach: f64, spacing: f64) -> u64 {
    let (low, high) = surface.bounding_box();
    let samples = |size: &Vector<D>, step: f64| size.iter().map(|s| (s / step).ceil().max(1.0)).product::<f64>();
    let mut step = spacing;
    let mut wide = reach;
    while samples(&(high - low).add_scalar(2.0 * wide), step) > MOST_SAMPLES {
        step *= 1.1;
        wide = reach.max(1.5 * step);
    }
    let low = low.add_scalar(-wide);
    let size = high.add_scalar(wide) - low;
    let counts: [usize; D] = std::array::from_fn(|d| (size[d] / step).ceil().max(1.0) as usize);
    let total: usize = counts.iter().product();
    let cell: f64 = (0..D).map(|d| size[d] / counts[d] as f64).product();
    let inside = (0..total)
        .filter(|index| {
            let mut rest = *index;
            let x = Vector::<D>::from_fn(|d, _| {
                let k = rest % counts[d];
                rest /= counts[d];
                low[d] + size[d] * (k as f64 + 0.5) / counts[d] as f64
            });
            surface.signed_distance(&x).abs() <= wide
        })
        .count();
    let particles = inside as f64 * cell * (reach / wide) / spacing.powi(D as i32);
    // What is no number is no number that would fit into any memory.
    if particles.is_nan() { u64::MAX } else { particles.round() as u64 }
}

/// Resident memory of a closest-point level set of so many particles: columns, search structures, answers, a frame
/// and a checkpoint in the making, and the fits of up to half of the particles.
#[must_use]
pub fn memory_bytes<const D: usize>(particles: u64, method: &PcpMethod) -> u64 {
    let terms = term_count::<D>(method.degree);
    let columns = 8 * (3 * D + 4);
    let search = 8 * (D + 4);
    let output = 8 * (3 * D + 10);
    let geometry = 8 * (D * D + 8 * D + 16);
    let fits = match method.neighborhood {
        // ψ and each coordinate, several points of the surface a fit, and the initial positions.
        NeighborhoodChoice::Material { .. } => 8 * (1 + D) * terms + 4 * geometry + 2 * search,
        _ => (8 * terms + 2 * geometry) / 2,
    };
    particles.saturating_mul((3 * columns + search + output + fits) as u64)
}
