//! Which reconstructions and time steps are stable under motion by mean curvature.
//!
//! Measured on circles and spheres of 20 to 100 spacings over hundreds of steps (docs/results/front-notes.md). Slightly beyond
//! a limit the front grows slowly, far beyond it at once.

use crate::time::PathIntegrator;

/// Limits of stable steps, dt/h².
struct StepLimits {
    /// Four stages without weights in the plane.
    plane: f64,
    /// Four stages without weights in space, for degrees 2, 3 and 4: wide reconstructions are stable for shorter steps.
    space: [f64; 3],
    /// Four stages with weights.
    weighted: f64,
    /// Largest k of the weights exp(−k t²) in the plane for which the limit without weights still holds.
    harmless_weight: f64,
    /// Limit of two stages relative to that of four: 2/2.785, from the real parts of their regions of stability.
    two_stages: f64,
}

const LIMITS: StepLimits =
    StepLimits { plane: 0.8, space: [0.7, 0.65, 0.55], weighted: 0.5, harmless_weight: 0.3, two_stages: 0.718 };

/// What a stable time step depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StabilityPlan {
    /// Integrator, whose number of stages counts.
    pub integrator: PathIntegrator,
    /// Dimension of the space.
    pub dimension: usize,
    /// Degree of the local polynomials.
    pub degree: usize,
    /// k of the weights exp(−k t²) of their fits.
    pub weight: f64,
}

/// The fewest particles of a stable reconstruction. The ten that the paper uses on a surface are too few.
#[must_use]
pub fn fewest_particles(dimension: usize, degree: usize) -> usize {
    match (dimension, degree) {
        (2, 2) => 6,
        (2, 3) => 7,
        (2, _) => 10,
        (_, 2) => 14,
        (_, 3) => 16,
        _ => 32,
    }
}

/// The largest stable k of the weights exp(−k t²). Under larger weights too few particles count.
#[must_use]
pub fn most_weight(dimension: usize) -> f64 {
    if dimension == 2 { 1.0 } else { 0.5 }
}

/// The longest stable step, dt/h².
#[must_use]
pub fn longest_step(plan: &StabilityPlan) -> f64 {
    let (unweighted, harmless) = match plan.dimension {
        2 => (LIMITS.plane, LIMITS.harmless_weight),
        _ => (LIMITS.space[plan.degree.clamp(2, 4) - 2], 0.0),
    };
    let four_stages = if plan.weight > harmless { LIMITS.weighted } else { unweighted };
    match plan.integrator {
        PathIntegrator::TvdRk2 => four_stages * LIMITS.two_stages,
        PathIntegrator::Rk4 | PathIntegrator::Dopri5 { .. } => four_stages,
    }
}
