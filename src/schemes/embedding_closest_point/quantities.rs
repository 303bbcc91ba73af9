//! What series and reports of the embedding show.

use crate::schemes::measured_errors;
use crate::simulation::Quantity;
use crate::simulation::quantity::quantities;

quantities! {
    /// Scalars of the series.
    pub OBSERVABLES {
        TIME = "time", "time", "Scene time; of one-step problems the number of applications.";
        ERROR_RELATIVE = "error_relative", "", "Size of the error by that of the exact value.";
        ERROR_MAX = "error_max", "of the field", "Largest error over the points.";
    }
}

/// Norms of the report.
pub static NORMS: &[&Quantity] = &[&measured_errors::MAX, &measured_errors::RELATIVE, &measured_errors::MAX_RELATIVE];
