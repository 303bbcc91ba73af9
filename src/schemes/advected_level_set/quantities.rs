//! What frames, series and reports of an advected level set show.

use super::system::FieldChoice;
use crate::schemes::measured_errors;
use crate::simulation::Quantity;
use crate::simulation::fields::{COMMON_FIELDS, SURFACE_FIELDS};
use crate::simulation::quantity::{quantities, without_repetition};

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

quantities! {
    /// Fields of frames that only this scheme has.
    pub OWN_FIELDS {
        VELOCITY = "velocity", "length/time", "Velocity of the flow at the particle.";
        PSI = "psi", "length", "Level that the particle carries unchanged.";
    }
}

/// Norms of the report.
pub static NORMS: &[&Quantity] =
    &[&measured_errors::RMS, &measured_errors::MAX, &measured_errors::MEAN, &measured_errors::RELATIVE];

/// Fields of frames.
#[must_use]
pub fn fields(choice: FieldChoice) -> Vec<&'static Quantity> {
    let mut fields = without_repetition(&[SURFACE_FIELDS, &[&VELOCITY], COMMON_FIELDS]);
    if choice == FieldChoice::Dual {
        fields.push(&PSI);
    }
    fields
}
