//! The standing wave on the sides of a layer, as a run starts with it.

use crate::schemes::capillary_wave::CapillaryWave;

/// A wave a₀ cos(k (x − crest)) on both sides of a layer, crests opposite each other.
#[derive(Debug, Clone, PartialEq)]
pub struct StandingWave {
    /// Wave number k.
    pub wavenumber: f64,
    /// Place of a crest, along x.
    pub crest: f64,
    /// Amplitude a₀ at the start.
    pub amplitude: f64,
    /// Exact for small amplitudes; None where it does not hold.
    pub theory: Option<CapillaryWave>,
}
