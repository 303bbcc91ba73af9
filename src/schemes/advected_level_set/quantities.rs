//! What series and reports of an advected level set show.

use crate::schemes::measured_errors;
use crate::simulation::Quantity;
use crate::simulation::quantity::quantities;

quantities! {
    /// Scalars of the series.
    pub OBSERVABLES {
        TIME = "time", "time", "Scene time.";
        TIME_STEP = "time_step", "time", "Length of a step.";
        AREA = "area", "length^2", "Enclosed area, where it was measured in this step.";
        VOLUME = "volume", "length^3", "Enclosed volume, where it was measured in this step.";
        VOLUME_DRIFT = "volume_drift", "", "Relative change of the enclosed area or volume since the start.";
        BAND_PARTICLES = "band_particles", "", "Particles in the narrow band, right after a redistancing.";
        CFL = "cfl", "spacings", "Longest way of a particle in a step so far.";
        RESCUED_FITS = "rescued_fits", "", "Fits and queries so far that needed a fallback.";
    }
}

/// Norms of the report.
pub static NORMS: &[&Quantity] =
    &[&measured_errors::RMS, &measured_errors::MAX, &measured_errors::MEAN, &measured_errors::RELATIVE];
