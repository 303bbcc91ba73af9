//! What series and reports of a front show.

use crate::schemes::measured_errors;
use crate::simulation::Quantity;
use crate::simulation::quantity::{quantities, without_repetition};

quantities! {
    /// Scalars of the series.
    pub OBSERVABLES {
        TIME = "time", "time", "Scene time.";
        TIME_STEP = "time_step", "time", "Length of a step.";
        FOOT_POINTS = "foot_points", "", "Particles of the front.";
        CURVATURE_MEAN = "curvature_mean", "1/length", "Mean over the particles of the divergence of the normal.";
        RADIUS_MEAN = "radius_mean", "length", "Mean distance of the particles from the center of the ball at the start.";
        CFL = "cfl", "spacings", "Longest way of a particle in a step so far.";
        UNRESOLVED = "unresolved", "", "Grid points so far that got no foot-point.";
        SWEPT = "swept", "", "Particles so far that another segment has passed.";
        KEPT = "kept", "", "Moved particles so far that stayed for want of a reconstruction.";
    }
}

quantities! {
    /// Norms of the report that only this scheme has.
    pub OWN_NORMS {
        L2 = "l2", "of the quantity", "L2 norm over the angle (GBPM eq. 18).";
        COVERAGE_H = "coverage_h", "spacings", "Largest distance from the exact front to a particle.";
        GAP_H = "gap_h", "spacings", "Largest gap along the front.";
        DEVIATION = "deviation", "of the quantity", "Standard deviation over the particles.";
        COUNT = "count", "", "Number of items, no error.";
        TIME_NORM = "time", "time", "A time, no error.";
    }
}

/// Norms of the report.
#[must_use]
pub fn norms() -> Vec<&'static Quantity> {
    let shared: &[&Quantity] =
        &[&measured_errors::RMS, &measured_errors::MAX, &measured_errors::MEAN, &measured_errors::ABSOLUTE];
    without_repetition(&[shared, OWN_NORMS])
}
