//! Counts and dimensionless numbers that a report shows.

use super::config::SphConfig;
use super::dimensionless::{DimensionlessNumbers, Scales};
use super::interactions::BodyForce;
use super::species::Species;
use super::system::SphSystem;
use crate::schemes::measured_errors::{FLOW_FITS, closest_point_diagnostics, support_diagnostics};
use crate::simulation::Diagnostic;

/// Numbers of a run at a speed.
fn numbers<const D: usize>(system: &SphSystem<D>, speed: f64) -> DimensionlessNumbers {
    let SphConfig { fluids, tension, spacing, wave, body_force, .. } = &system.config;
    let largest = system.droplets.ball_curvatures.iter().copied().fold(0.0, f64::max);
    let diameter = match wave {
        Some(wave) => 2.0 * std::f64::consts::PI / wave.wavenumber,
        None => 2.0 * (D - 1) as f64 / largest,
    };
    DimensionlessNumbers::from(Scales {
        fluids: *fluids,
        tension: *tension,
        diameter,
        speed,
        gravity: body_force.as_ref().map_or(0.0, BodyForce::constant_strength),
        spacing: *spacing,
    })
}

/// The diagnostics of a run, with the largest speed that was measured.
pub(super) fn diagnostics<const D: usize>(system: &SphSystem<D>, largest_speed: f64) -> Vec<Diagnostic> {
    let mut diagnostics = Vec::new();
    if let Some(interface) = system.interface.level_set() {
        diagnostics.extend(closest_point_diagnostics(interface.surface.fit_diagnostics()));
        let doc = "Curvatures that were bounded to what the spacing resolves.";
        diagnostics.push(Diagnostic::count("curvature.clipped", interface.bounded, doc));
    }
    if let Some(flow) = system.equations.fits() {
        diagnostics.extend(support_diagnostics(FLOW_FITS, &flow.fit_diagnostics));
    }
    diagnostics.extend(numbers(system, largest_speed).diagnostics());
    let doc = "Particles without a neighbor of their own fluid that took the side of their neighbors.";
    diagnostics.push(Diagnostic::count("strays.absorbed", system.strays.absorbed, doc));
    let fragments = (0..system.flow.count())
        .filter(|i| system.flow.species[*i] == Species::Inside && system.droplets.is_fragment(*i));
    let doc = "Particles inside that are in fragments too small for a droplet; means of the curvature leave them out.";
    diagnostics.push(Diagnostic::count("fragments.particles", fragments.count() as u64, doc));
    diagnostics
}
