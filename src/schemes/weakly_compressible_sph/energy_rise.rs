//! The largest rise of the energy of a run above what it had before.

use crate::simulation::section::known;
use crate::simulation::{Component, LoadError, Section};

/// How far the energy rose above its largest value before. Viscosity takes energy, so what is left after the work of the body
/// force never grows in an exact run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EnergyRise {
    /// The largest energy up to now; NaN before the first.
    highest: f64,
    /// The largest rise of one measurement above those before it.
    pub largest: f64,
}

impl EnergyRise {
    /// Nothing measured yet.
    pub const NONE: Self = Self { highest: f64::NAN, largest: 0.0 };

    /// Takes an energy: kinetic, elastic and surface energy less the work done.
    pub fn take(&mut self, energy: f64) {
        if self.highest.is_finite() {
            self.largest = self.largest.max(energy - self.highest);
        }
        // The maximum of an unknown and a number is the number.
        self.highest = self.highest.max(energy);
    }
}

impl Component for EnergyRise {
    fn save(&self, section: &mut Section) {
        section.put_optional("highest", known(self.highest));
        section.put_real("largest", self.largest);
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        Ok(Self { highest: section.optional("highest")?.unwrap_or(f64::NAN), largest: section.real("largest")? })
    }
}

#[cfg(test)]
mod tests {
    use super::EnergyRise;

    #[test]
    fn a_rise_counts_from_the_highest_value_before() {
        let mut rise = EnergyRise::NONE;
        for energy in [f64::NAN, 2.0, 1.0, 1.75, 2.25, 0.5, 2.0] {
            rise.take(energy);
        }
        assert!((rise.largest - 0.25).abs() < 1e-15, "{rise:?}");
    }
}
