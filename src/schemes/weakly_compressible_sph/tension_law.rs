//! Laws of a surface tension that is not the same everywhere.
//!
//! A surfactant covers a share x = Γ/Γ∞ of the interface and lowers its tension τ₀. With the surface energy E(x) by area,
//! τ = E − x E′:
//!
//! | equation of state | τ/τ₀ | E/τ₀ |
//! | --- | --- | --- |
//! | linear (dilute) | 1 − βx | 1 + βx ln x |
//! | Langmuir | 1 + β ln(1 − x) | 1 + β (x ln x + (1 − x) ln(1 − x)) |
//!
//! The energy of the second follows from mixing covered and free places. Terms of E that are linear in x change nothing, since the
//! surfactant is kept (Pawar and Stebe 1996).

use crate::geometry::Vector;

/// How the tension follows from the coverage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EquationOfState {
    /// 1 − βx.
    Linear,
    /// 1 + β ln(1 − x).
    Langmuir,
}

/// Coverage up to which the logarithm is followed. Runs end before (check `coverage_most`).
const FULL: f64 = 1.0 - 1e-9;

/// An insoluble surfactant on the interface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfactantConfig<const D: usize> {
    /// How the tension follows from the coverage.
    pub equation: EquationOfState,
    /// The elasticity β.
    pub elasticity: f64,
    /// Coverage at the start in the middle of the box.
    pub coverage: f64,
    /// Change of the coverage at the start by length.
    pub slope: Vector<D>,
    /// Diffusivity along the interface.
    pub diffusivity: f64,
}

impl<const D: usize> SurfactantConfig<D> {
    /// τ/τ₀ at a coverage.
    #[must_use]
    pub fn tension(&self, coverage: f64) -> f64 {
        match self.equation {
            EquationOfState::Linear => 1.0 - self.elasticity * coverage,
            EquationOfState::Langmuir => 1.0 + self.elasticity * (1.0 - coverage.min(FULL)).ln(),
        }
    }

    /// The derivative of τ/τ₀ by the coverage.
    #[must_use]
    pub fn tension_slope(&self, coverage: f64) -> f64 {
        match self.equation {
            EquationOfState::Linear => -self.elasticity,
            EquationOfState::Langmuir => -self.elasticity / (1.0 - coverage.min(FULL)),
        }
    }

    /// E/τ₀ at a coverage.
    #[must_use]
    pub fn energy(&self, coverage: f64) -> f64 {
        let entropy = |x: f64| if x > 0.0 { x * x.ln() } else { 0.0 };
        let mixing = match self.equation {
            EquationOfState::Linear => entropy(coverage),
            EquationOfState::Langmuir => entropy(coverage) + entropy(1.0 - coverage),
        };
        1.0 + self.elasticity * mixing
    }
}

/// What a tension that varies depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TensionLaw<const D: usize> {
    /// τ₀ (1 + b·x) with x from the middle of the box, as a gradient of temperature sets it.
    Slope {
        /// b.
        slope: Vector<D>,
        /// Largest τ/τ₀ on the drop at the start.
        largest: f64,
        /// Whether the drop is a circle or a sphere at the start, for which theory knows the drift.
        is_ball: bool,
    },
    /// A surfactant.
    Surfactant(SurfactantConfig<D>),
}

#[cfg(test)]
mod tests {
    use super::{EquationOfState, SurfactantConfig};
    use crate::geometry::Vector;

    #[test]
    fn tension_and_its_slope_follow_from_the_energy() {
        for equation in [EquationOfState::Linear, EquationOfState::Langmuir] {
            let slope = Vector::<2>::zeros();
            let config = SurfactantConfig { equation, elasticity: 0.3, coverage: 0.2, slope, diffusivity: 0.0 };
            for x in [0.05, 0.3, 0.8] {
                let by = |f: &dyn Fn(f64) -> f64| (f(x + 1e-5) - f(x - 1e-5)) / 2e-5;
                let (energy, tension) = (|x| config.energy(x), |x| config.tension(x));
                // E is known up to a term that is linear in x, which τ = E − x E′ does not see.
                assert!((config.tension(x) - (energy(x) - x * by(&energy))).abs() < 3e-9 * 100.0, "{equation:?} {x}");
                assert!((config.tension_slope(x) - by(&tension)).abs() < 1e-8);
            }
            assert!(config.energy(0.0) == 1.0 && config.tension(0.0) == 1.0);
        }
    }
}
