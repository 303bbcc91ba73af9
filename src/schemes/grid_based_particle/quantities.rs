//! What frames, series and reports of a front show.

use super::segments::Segments;
use crate::schemes::measured_errors;
use crate::simulation::Quantity;
use crate::simulation::fields::COMMON_FIELDS;
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
    /// Fields of frames that only this scheme has.
    pub OWN_FIELDS {
        NORMAL = "normal", "", "Unit normal of the front, outward; of a wave front its direction of travel.";
        CURVATURE = "curvature", "1/length", "Divergence of the unit normal.";
        GAUSS_CURVATURE = "gauss_curvature", "1/length^2", "Product of the principal curvatures.";
        VELOCITY = "velocity", "length/time", "Velocity of the front at the particle.";
        GRID_POINT = "grid_point", "length", "Grid point whose closest point the particle is.";
        LEVEL = "level", "", "Level of refinement of the grid point.";
        PARAMETER = "parameter", "", "Position along its closed part of the front at the start, from 0 to 1.";
        SEGMENT = "segment", "", "Number of its closed part of the front at the start.";
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

/// Every field that frames of this scheme may show.
#[must_use]
pub fn all_fields() -> Vec<&'static Quantity> {
    without_repetition(&[OWN_FIELDS, COMMON_FIELDS])
}

/// Fields of frames of a surface or curve in D dimensions; `is_curve_in_space` for wave fronts.
#[must_use]
pub fn fields(dimension: usize, is_curve_in_space: bool, segments: &Segments) -> Vec<&'static Quantity> {
    let mut fields = vec![&NORMAL, &CURVATURE, &VELOCITY, &GRID_POINT, &LEVEL, &SEGMENT];
    fields.extend(COMMON_FIELDS);
    if dimension == 3 && !is_curve_in_space {
        fields.push(&GAUSS_CURVATURE);
    }
    if segments.parameter.is_some() {
        fields.push(&PARAMETER);
    }
    fields
}
