//! How long a step may be.

use super::parts::{Discretization, Integrator, SphParts};
use std::f64::consts::PI;

/// The speed that the paper reckons with (B.11).
pub const REFERENCE_SPEED: f64 = 3.0;

/// The longest stable step at a largest speed, and what binds it.
///
/// Kick–drift–kick (measured): min(.4 ε/(c + u), .06 ρ ε²/η); predictor–corrector (PCP eq. B.11): .25 and .125. With .4 and
/// .25, the capillary limit √(ρ ε³/2πτ); for both .25 √(ε/a) for a force from outside.
#[must_use]
pub fn longest_step<const D: usize>(parts: &SphParts<D>, speed: f64) -> (f64, &'static str) {
    let epsilon = parts.smoothing_length;
    let (acoustic, viscous, capillary) = match (parts.integrator, parts.discretization) {
        // Gradients by fits see shorter waves than sums over kernels (measured: .4 fails at once, .17 holds).
        (_, Discretization::Dcpse(_)) => (0.17, 0.06, 0.25),
        (Integrator::KickDriftKick, _) => (0.4, 0.06, 0.4),
        (Integrator::PredictorCorrector, _) => (0.25, 0.125, 0.25),
    };
    let mut limit = (f64::INFINITY, "nothing");
    let mut bind = |step: f64, name| {
        if step < limit.0 {
            limit = (step, name);
        }
    };
    for fluid in [&parts.inside, &parts.outside] {
        bind(acoustic * epsilon / (fluid.sound_speed + speed), "the speed of sound");
        bind(viscous * fluid.density * epsilon * epsilon / fluid.viscosity, "viscosity");
        bind(
            capillary * (fluid.density * epsilon.powi(3) / (2.0 * PI * parts.tension.abs())).sqrt(),
            "capillary waves",
        );
    }
    if let Some(force) = &parts.body_force {
        bind(0.25 * (epsilon / force.strength()).sqrt(), "the force from outside");
    }
    limit
}
