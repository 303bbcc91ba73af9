//! What frames, series and reports of the embedding show.

use crate::schemes::measured_errors;
use crate::simulation::Quantity;
use crate::simulation::fields::COMMON_FIELDS;
use crate::simulation::quantity::{quantities, without_repetition};

quantities! {
    /// Scalars of the series.
    pub OBSERVABLES {
        TIME = "time", "time", "Scene time; of one-step problems the number of applications.";
        ERROR_RELATIVE = "error_relative", "", "Size of the error by that of the exact value.";
        ERROR_MAX = "error_max", "of the field", "Largest error over the points.";
    }
}

quantities! {
    /// Fields of frames.
    pub FIELDS {
        VALUE = "value", "of the field", "Computed value; NaN before the first step.";
        FIELD = "field", "of the field", "Given field.";
        REFERENCE = "reference", "of the field", "Exact value at the point.";
        NORMAL = "normal", "", "Unit normal at the point, outward.";
        CURVATURE = "curvature", "1/length", "Exact divergence of the unit normal at the point.";
    }
}

/// Norms of the report.
pub static NORMS: &[&Quantity] = &[&measured_errors::MAX, &measured_errors::RELATIVE, &measured_errors::MAX_RELATIVE];

/// Every field of frames.
#[must_use]
pub fn all_fields() -> Vec<&'static Quantity> {
    without_repetition(&[FIELDS, COMMON_FIELDS])
}
