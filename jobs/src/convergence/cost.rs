//! What a level costs: D h^−q, from levels that were run.

use super::Level;
use super::fits::slope;

/// CPU seconds over the spacing: through the finest level, with a fitted exponent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cost {
    /// Spacing of the finest level.
    spacing: f64,
    /// CPU seconds of that level.
    cpu_s: f64,
    /// Exponent q.
    pub exponent: f64,
}

/// Exponents that are possible: a set-up of surfaces at least, steps in space with a step of h² at most.
const EXPONENTS: (f64, f64) = (1.0, 6.0);
/// Levels over which the exponent is fitted: the finest ones, since the start of a process weighs in the cost of coarse ones.
const LEVELS: usize = 3;

impl Cost {
    /// The cost over levels, the coarsest first; None for fewer than two with a cost.
    #[must_use]
    pub fn new(levels: &[Level]) -> Option<Self> {
        let known: Vec<&Level> = levels.iter().filter(|level| level.cpu_s > 0.0 && level.spacing > 0.0).collect();
        let finest = known.last()?;
        let fitted: Vec<(f64, f64, f64)> = known
            .iter()
            .rev()
            .take(LEVELS)
            .map(|level| (level.spacing.ln(), level.cpu_s.ln(), level.spacing.recip()))
            .collect();
        let exponent = (-slope(&fitted)?.value).clamp(EXPONENTS.0, EXPONENTS.1);
        Some(Self { spacing: finest.spacing, cpu_s: finest.cpu_s, exponent })
    }

    /// CPU seconds at a spacing.
    #[must_use]
    pub fn at(&self, spacing: f64) -> f64 {
        self.cpu_s * (self.spacing / spacing).powf(self.exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::Cost;
    use crate::convergence::Level;

    #[test]
    fn the_cost_goes_on_as_the_finest_levels_do() {
        let level = |spacing: f64| Level { spacing, value: 0.0, cpu_s: 0.02 + 1e-3 * spacing.powi(-3) };
        let levels: Vec<Level> = [0.2, 0.1, 0.05, 0.025, 0.0125].map(level).to_vec();
        let cost = Cost::new(&levels).unwrap();
        assert!((cost.exponent - 3.0).abs() < 0.05, "{cost:?}");
        assert!((cost.at(0.00625) / level(0.00625).cpu_s - 1.0).abs() < 0.05);
        assert!((cost.at(0.0125) - levels[4].cpu_s).abs() < 1e-9);
        assert_eq!(Cost::new(&levels[..1]), None);
    }
}
