//! How many particles a band will hold and what memory they take, before they are made.

use crate::geometry::{Surface, Vector};
use crate::polynomials::multi_index::term_count;

/// Sample points of the bounding box at most.
const MOST_SAMPLES: f64 = 2e5;

/// Particles of spacing h within `reach` of a surface: the lattice itself where it is small, else a coarser one.
#[must_use]
pub fn band_particles<const D: usize>(surface: &dyn Surface<D>, reach: f64, spacing: f64) -> u64 {
    let (low, high) = surface.bounding_box();
    let low = low.add_scalar(-reach);
    let size = high.add_scalar(reach) - low;
    let volume: f64 = size.iter().product();
    let step = (volume / MOST_SAMPLES).powf(1.0 / D as f64).max(spacing);
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
            surface.signed_distance(&x).abs() <= reach
        })
        .count();
    (inside as f64 * cell / spacing.powi(D as i32)).round() as u64
}

/// Resident memory of a closest-point level set of so many particles: columns, search structures, answers, a frame
/// and a checkpoint in the making, and the fits of up to half of the particles.
#[must_use]
pub fn memory_bytes<const D: usize>(particles: u64, degree: usize) -> u64 {
    let terms = if D == 2 { term_count::<2>(degree) } else { term_count::<3>(degree) };
    let columns = 8 * (3 * D + 4);
    let search = 8 * (D + 4);
    let output = 8 * (3 * D + 10);
    let fits = 8 * (terms + 4 * D + 12) / 2;
    particles * (3 * columns + search + output + fits) as u64
}
