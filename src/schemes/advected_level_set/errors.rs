//! Errors of particles and surface at one time.

use crate::schemes::measured_errors::entry;
use crate::simulation::{Component, ErrorEntry, LoadError, Section};

/// Errors at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MeasuredErrors {
    pub time: f64,
    pub measure_relative: f64,
    pub distances: Option<DistanceErrors>,
}

/// Errors of distances, where the exact front is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DistanceErrors {
    pub phi_rms: f64,
    pub phi_max: f64,
    pub samples_mean: f64,
    pub samples_max: f64,
}

impl Component for MeasuredErrors {
    fn save(&self, section: &mut Section) {
        section.put_real("time", self.time);
        section.put_real("measure_relative", self.measure_relative);
        section.put_optional("phi_rms", self.distances.map(|errors| errors.phi_rms));
        section.put_optional("phi_max", self.distances.map(|errors| errors.phi_max));
        section.put_optional("samples_mean", self.distances.map(|errors| errors.samples_mean));
        section.put_optional("samples_max", self.distances.map(|errors| errors.samples_max));
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        let distances = match section.optional("phi_rms")? {
            None => None,
            Some(phi_rms) => Some(DistanceErrors {
                phi_rms,
                phi_max: section.real("phi_max")?,
                samples_mean: section.real("samples_mean")?,
                samples_max: section.real("samples_max")?,
            }),
        };
        Ok(Self { time: section.real("time")?, measure_relative: section.real("measure_relative")?, distances })
    }
}

impl MeasuredErrors {
    pub fn entries(&self, dimension: usize) -> Vec<ErrorEntry> {
        let reference = "exact motion";
        let measure = if dimension == 2 { "area" } else { "volume" };
        let mut entries = vec![entry(measure, "relative", self.measure_relative, self.time, "conservation")];
        if let Some(DistanceErrors { phi_rms, phi_max, samples_mean, samples_max }) = self.distances {
            for (quantity, norm, value) in [
                ("phi", "rms", phi_rms),
                ("phi", "max", phi_max),
                ("samples", "mean", samples_mean),
                ("samples", "max", samples_max),
            ] {
                entries.push(entry(quantity, norm, value, self.time, reference));
            }
        }
        entries
    }
}
