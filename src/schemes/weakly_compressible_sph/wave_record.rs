//! Amplitude of the wave on the sides of a layer in a run, and its error against linear theory.

use super::smoothed_delta::smoothed_delta;
use super::standing_wave::StandingWave;
use super::system::SphSystem;
use crate::schemes::measured_errors::entry;
use crate::simulation::section::known;
use crate::simulation::{ErrorEntry, LoadError, Section};

impl<const D: usize> SphSystem<D> {
    /// The amplitude of a wave on the sides of a layer: the Fourier coefficient ∮ sin(k(x − crest))/k n_x dS by half the sides'
    /// projection ∮ |n_y| dS, with dS = V δ at the closest points. NaN without a level set.
    pub(super) fn wave_amplitude(&self, wave: &StandingWave, time: f64) -> f64 {
        let Some(level_set) = self.interface.level_set() else { return f64::NAN };
        let (particles, columns) = (&self.particles, &self.columns);
        let (phi, band) = (particles.scalar(columns.phi), particles.flag(columns.in_band));
        let (foot, normal) = (particles.vector(columns.closest_point), particles.vector(columns.normal));
        // The wave moves with the fluids.
        let crest = wave.crest + self.config.start_velocity[0] * time;
        let (mut wavy, mut plane) = (0.0, 0.0);
        for i in level_set.candidates().iter().copied().filter(|i| band[*i] == 1) {
            let area = self.flow.volume[i] * smoothed_delta(phi[i], self.config.smoothing_length);
            let phase = wave.wavenumber * (foot[i][0] - crest);
            wavy += area * phase.sin() / wave.wavenumber * normal[i][0];
            plane += area * normal[i][1].abs();
        }
        2.0 * wavy / plane
    }
}

/// Amplitude and errors of a wave in a run.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct WaveRecord {
    wave: StandingWave,
    /// At the last measured state; NaN before.
    pub amplitude: f64,
    /// Squared errors by a₀², over states at equal intervals.
    count: f64,
    squares: f64,
    largest: f64,
}

impl WaveRecord {
    /// Nothing measured yet.
    pub fn new(wave: StandingWave) -> Self {
        Self { wave, amplitude: f64::NAN, count: 0.0, squares: 0.0, largest: 0.0 }
    }

    /// Takes the state at a time; its error counts where the state is one of those at equal intervals.
    pub fn take<const D: usize>(&mut self, system: &SphSystem<D>, time: f64, counts: bool) {
        self.amplitude = system.wave_amplitude(&self.wave, time);
        // Without a level set there is no amplitude.
        if let Some(theory) = self.wave.theory.as_ref().filter(|_| counts && self.amplitude.is_finite()) {
            let expected = theory.amplitude_ratio(time);
            // A wave that has grown is compared with itself.
            let error = (self.amplitude / self.wave.amplitude - expected) / expected.abs().max(1.0);
            self.count += 1.0;
            self.squares += error * error;
            self.largest = self.largest.max(error.abs());
        }
    }

    /// Errors by a₀ against linear theory.
    pub fn errors(&self, time: f64) -> Vec<ErrorEntry> {
        if self.count == 0.0 {
            return Vec::new();
        }
        let reference = "linear theory (Prosperetti 1981), by the amplitude at the start, or by the present one of a wave that has grown";
        let rms = (self.squares / self.count).sqrt();
        vec![
            entry("wave_amplitude", "rms", rms, time, reference),
            entry("wave_amplitude", "max", self.largest, time, reference),
        ]
    }

    /// Saves what later reports depend on.
    pub fn save(&self, section: &mut Section) {
        section.put_optional("amplitude", known(self.amplitude));
        section.put_reals("errors", &[self.count, self.squares, self.largest]);
    }

    /// The record of a state that was saved.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn load(&self, section: &Section) -> Result<Self, LoadError> {
        let errors = section.reals_of("errors", 3)?;
        Ok(Self {
            wave: self.wave.clone(),
            amplitude: section.optional("amplitude")?.unwrap_or(f64::NAN),
            count: errors[0],
            squares: errors[1],
            largest: errors[2],
        })
    }
}
