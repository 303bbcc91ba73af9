//! Errors of redistanced particles against the exact surface.

use super::system::{Source, StaticSystem};
use crate::geometry::Surface;
use crate::parallel::{BLOCK, Interrupt, Interrupted};
use crate::schemes::measured_errors::ErrorNorms;
use crate::simulation::ErrorEntry;
use crate::time::Clock;
use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};

/// Quantities of [`particle_errors`].
const NAMES: [&str; 4] = ["phi", "closest_point", "normal", "curvature"];

/// Errors over the band, and of a remeshed level at the nodes of its grid; none where the surface is not known.
///
/// # Errors
/// [`Interrupted`] when the interrupt is raised.
pub(super) fn errors<const D: usize>(
    system: &StaticSystem<D>,
    Clock { step, time }: Clock,
    interrupt: &Interrupt,
) -> Result<Vec<ErrorEntry>, Interrupted> {
    let mut entries = Vec::new();
    let Some(surface) = &system.surface else { return Ok(entries) };
    if let Source::Grid(remeshing) = &system.source
        && step > 0
    {
        // The first interpolation is of the exact level; later ones are of distances that were computed.
        let mut norms = ErrorNorms::default();
        for (x, value) in remeshing.nodes().iter().zip(remeshing.values()) {
            let distance = surface.signed_distance(x);
            let exact = if step == 1 { system.initial.value(x, distance) } else { distance };
            if distance.abs() <= system.half_band {
                norms.add(value - exact);
            }
        }
        entries.extend(norms.entries("remeshed_level", time, "exact level at the nodes"));
    }
    // Each error is computed by itself, and the norms add them in the order of the particles.
    let of_particles: Vec<[Option<f64>; 4]> = (0..system.particles.len())
        .into_par_iter()
        .with_min_len(BLOCK)
        .map(|i| if interrupt.is_raised() { [None; 4] } else { particle_errors(system, surface.as_ref(), step, i) })
        .collect();
    interrupt.check()?;
    let mut norms = [ErrorNorms::default(); 4];
    for errors in of_particles {
        for (norms, error) in norms.iter_mut().zip(errors) {
            error.into_iter().for_each(|error| norms.add(error));
        }
    }
    let found = NAMES.iter().zip(&norms).filter(|(_, norms)| !norms.is_empty());
    entries.extend(found.flat_map(|(name, norms)| norms.entries(name, time, "exact surface")));
    Ok(entries)
}

/// Errors of distance, closest point, normal and curvature of one particle, where it is in the band and they are known.
fn particle_errors<const D: usize>(
    system: &StaticSystem<D>,
    surface: &dyn Surface<D>,
    step: u64,
    i: usize,
) -> [Option<f64>; 4] {
    let (particles, columns) = (&system.particles, &system.columns);
    if particles.flag(columns.in_band)[i] == 0 {
        return [None; 4];
    }
    let x = particles.positions()[i];
    let exact = surface.nearest(&x);
    let distance = Some(particles.scalar(columns.phi)[i] - exact.distance);
    // Where two points of the surface are nearly as close, another choice is no error.
    if step == 0 || surface.near_medial_axis(&x, system.spacing) {
        return [distance, None, None, None];
    }
    [
        distance,
        Some((particles.vector(columns.closest_point)[i] - exact.point).norm()),
        exact.normal.map(|normal| (particles.vector(columns.normal)[i] - normal).norm()),
        exact.curvature.map(|curvature| particles.scalar(columns.curvature)[i] - curvature),
    ]
}
