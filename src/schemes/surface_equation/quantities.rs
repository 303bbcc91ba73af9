//! What frames, series and reports of problems on surfaces show.

use crate::schemes::measured_errors;
use crate::simulation::Quantity;
use crate::simulation::quantity::{quantities, without_repetition};

quantities! {
    /// Scalars of the series, of all problems together.
    pub OBSERVABLES {
        TIME = "time", "time", "Scene time; of one-step problems the number of applications.";
        ERROR_RELATIVE = "error_relative", "", "Size of the error by that of the exact value.";
        ERROR_MAX = "error_max", "of the field", "Largest error over the points.";
        ITERATIONS = "iterations", "", "Iterations of the solver.";
        RESIDUAL = "residual", "", "Norm of b - A x by that of b.";
        CURVATURE_MEAN = "curvature_mean", "1/length", "Mean of the mean curvature, weighted by areas on points from outside.";
        GAUSS_INTEGRAL = "gauss_integral", "", "Integral of the Gauss curvature: 2 pi times the Euler characteristic.";
        INTEGRAL = "integral", "of the field times area", "Integral of the first field over the surface; its mean over the points where areas are not known.";
        LEAST = "least", "of the field", "Least value of the first field.";
        LARGEST = "largest", "of the field", "Largest value of the first field.";
        RATE = "rate", "of the field by time", "Root mean square of the rate of change at the end of the last step.";
        PROBE_0 = "probe_0", "of the field", "Value at the first probe.";
        PROBE_1 = "probe_1", "of the field", "Value at the second probe.";
        PROBE_2 = "probe_2", "of the field", "Value at the third probe.";
    }
}

quantities! {
    /// Fields of frames that several problems show. A problem declares its own fields in its file.
    pub FIELDS {
        VALUE = "value", "of the field", "Computed value; of two substances that of the first. NaN before the first step.";
        FIELD = "field", "of the field", "Given field, or right-hand side.";
        REFERENCE = "reference", "of the field", "Exact value at the point.";
        NORMAL = "normal", "", "Unit normal at the point, outward.";
        CURVATURE = "curvature", "1/length", "Exact divergence of the unit normal at the point.";
    }
}

quantities! {
    /// Norms of the report that only this scheme has.
    pub OWN_NORMS {
        ITERATIONS_NORM = "iterations", "", "Number of iterations, no error.";
        RESIDUAL_NORM = "residual", "", "Norm of b - A x by that of b.";
        PEAK = "peak", "of the quantity", "Largest value so far, no error.";
        STD = "std", "of the quantity", "Standard deviation over the points.";
        RATE_NORM = "rate", "of the quantity by time", "Root mean square of the rate of change.";
    }
}

/// The probes of a surface, as far as it has them.
pub(super) static PROBES: [&Quantity; 3] = [&PROBE_0, &PROBE_1, &PROBE_2];

/// Norms of the report.
#[must_use]
pub fn norms() -> Vec<&'static Quantity> {
    let shared: &[&Quantity] = &[&measured_errors::MAX, &measured_errors::RELATIVE, &measured_errors::MAX_RELATIVE];
    without_repetition(&[shared, OWN_NORMS])
}
