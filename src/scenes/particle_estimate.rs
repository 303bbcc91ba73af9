//! How many particles a band will hold and what memory they take, before they are made.

use crate::closest_point::PcpMethod;
use crate::closest_point::method::NeighborhoodChoice;
use crate::geometry::{Surface, Vector};
use crate::polynomials::multi_index::term_count;
use crate::scene::CloudSize;
use crate::spec::Violation;
use serde_json::json;

/// The thinnest band that is measured as it is, as a part of its shape's extent.
const FINEST_PART: f64 = 16.0;
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
    Some(Violation::new("/spacing", "range", detail, spacing, allowed))
}

/// Particles of spacing h within `reach` of a surface: the measure of the band over h^D.
///
/// Cubes are halved where the band's border passes through them (the distance is 1-Lipschitz, so its value at the center
/// and the half diagonal tell) until they are small against the band; those count by the part of their width that lies
/// inside. A band much thinner than its shape is widened for the count, since its measure is linear in its width.
#[must_use]
pub fn band_particles<const D: usize>(surface: &dyn Surface<D>, reach: f64, spacing: f64) -> u64 {
    let (low, high) = surface.bounding_box();
    let wide = reach.max((high - low).max() / FINEST_PART);
    let half = 0.5 * (high - low).max() + wide;
    let mut cubes = vec![((low + high) * 0.5, half)];
    let mut measure = 0.0;
    while let Some((center, half)) = cubes.pop() {
        let distance = surface.signed_distance(&center).abs();
        let diagonal = half * (D as f64).sqrt();
        let volume = (2.0 * half).powi(D as i32);
        if distance + diagonal <= wide {
            measure += volume;
        } else if half <= 0.25 * wide {
            measure += volume * (0.5 + 0.5 * (wide - distance) / half).clamp(0.0, 1.0);
        } else if distance - diagonal < wide {
            let quarter = 0.5 * half;
            cubes.extend((0..1 << D).map(|corner: usize| {
                let offset = |d: usize| if corner >> d & 1 == 1 { quarter } else { -quarter };
                (Vector::<D>::from_fn(|d, _| center[d] + offset(d)), quarter)
            }));
        }
    }
    let particles = measure * (reach / wide) / spacing.powi(D as i32);
    // What is no number is no number that would fit into any memory.
    if particles.is_nan() { u64::MAX } else { particles.round() as u64 }
}

/// Particles of spacing h within `reach` of the surface of a shape: counted where the surface is known, else by the size of
/// the points from outside that tell it. Points with a level are the particles themselves; of a mesh, 2·reach times its area.
#[must_use]
pub fn shape_particles<const D: usize>(
    surface: Option<&dyn Surface<D>>,
    size: Option<&CloudSize>,
    reach: f64,
    spacing: f64,
) -> u64 {
    match (surface, size) {
        (Some(surface), _) => band_particles(surface, reach, spacing),
        (None, Some(CloudSize { area: Some(area), .. })) => {
            (2.0 * reach * area / spacing.powi(D as i32)).round() as u64
        }
        (None, Some(size)) => size.points,
        (None, None) => 0,
    }
}

/// Resident memory of a closest-point level set of so many particles: columns, search structures, answers, a frame
/// and a checkpoint in the making, and the fits (as measured: 450 bytes a particle in the plane, 610 in space).
#[must_use]
pub fn memory_bytes<const D: usize>(particles: u64, method: &PcpMethod) -> u64 {
    let terms = term_count::<D>(method.degree);
    let columns = 8 * (3 * D + 4);
    let search = 8 * (D + 4);
    let output = 8 * (3 * D + 10);
    let geometry = 8 * (D * D + 8 * D + 16);
    // ψ and each coordinate where fits are made in initial positions.
    let fields = if let NeighborhoodChoice::Material { .. } = method.neighborhood { 1 + D } else { 1 };
    // About one particle in seven is a sample with a fit.
    let fits = (8 * fields * terms + geometry) / 7;
    particles.saturating_mul((3 * columns + search + output + fits) as u64)
}

/// Half the least extent of a surface.
#[must_use]
pub fn half_extent<const D: usize>(surface: &dyn Surface<D>) -> f64 {
    let (low, high) = surface.bounding_box();
    0.5 * (high - low).min()
}
