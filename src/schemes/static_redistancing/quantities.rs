//! What frames, series and reports of a static redistancing show.

use crate::schemes::measured_errors;
use crate::simulation::Quantity;
use crate::simulation::fields::{COMMON_FIELDS, SURFACE_FIELDS};
use crate::simulation::quantity::{quantities, without_repetition};

quantities! {
    /// Scalars of the series.
    pub OBSERVABLES {
        TIME = "time", "redistancings", "Redistancings done.";
        PHI_ERROR_RMS = "phi_error_rms", "length", "Root mean square error of the signed distance over the band.";
        PHI_ERROR_MAX = "phi_error_max", "length", "Largest error of the signed distance over the band.";
        RESCUED_FITS = "rescued_fits", "", "Fits and queries so far that needed a fallback.";
    }
}

/// Norms of the report.
pub static NORMS: &[&Quantity] = &[&measured_errors::RMS, &measured_errors::MAX];

/// Fields of frames.
#[must_use]
pub fn fields() -> Vec<&'static Quantity> {
    without_repetition(&[SURFACE_FIELDS, COMMON_FIELDS])
}
