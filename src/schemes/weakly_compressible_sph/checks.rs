//! The invariants that a run of two fluids watches: their values, limits and reasons.
//!
//! The limits were set on runs known to be good and bad (docs/results/droplet-notes.md). Budgets and the area have limits only
//! with the balanced force on densities by summation, whose budgets close; otherwise their values are shown without a limit.

use crate::simulation::section::known;
use crate::simulation::{Check, Component, Divergence, LoadError, Section};

/// Limits of the checks.
pub(super) struct Limits {
    /// Energy gained from nothing, by the surface energy at the start: good runs stay below 1e-4.
    pub energy: f64,
    /// Energy gain that is a doubt.
    pub energy_doubt: f64,
    /// Momentum gained from nothing, by Σ m |u|: good runs stay below 1e-10.
    pub momentum: f64,
    /// Distance in h below which a pair is too close.
    pub pair_distance: f64,
    /// Share of particles in pairs that are too close, of a drop that was single all the time and of others, and the
    /// measurements in a row for which it must last. Where drops merge, particles of the film between them crowd for a while:
    /// 0.7 % of all at 7 particles to a radius (measured). Shifting pulls such pairs apart again: a drop that divides rightly has
    /// 0.5 % of them before it parts (measured at 24 particles to a radius).
    pub crowded: f64,
    pub crowded_in_passing: f64,
    pub crowded_measurements: u64,
    /// Relative change of the area or volume of a single drop.
    pub area: f64,
    /// Share of particles on the wrong side of the fits that is a doubt, and the steps for which it must last.
    pub sides_doubt: f64,
    pub sides_steps: u64,
    /// Share that ends a run: necks that part reach 0.14 for a while (measured).
    pub sides: f64,
    /// Particles that the drops lost to the other fluid, or gained, by those at the start.
    pub strays: f64,
    /// Largest Mach number without a doubt.
    pub mach_doubt: f64,
    /// Work of surface tension at rest in a capillary time √(ρR³/τ), by the surface energy.
    pub creep: f64,
    /// Distance in h of a particle behind a wall.
    pub wall_depth: f64,
    /// A run is at rest for the check of creep below this share of kinetic by surface energy.
    pub rest: f64,
}

pub(super) const LIMITS: Limits = Limits {
    energy: 1e-2,
    energy_doubt: 2e-4,
    momentum: 1e-8,
    pair_distance: 0.3,
    crowded: 5e-3,
    crowded_in_passing: 2e-2,
    crowded_measurements: 5,
    area: 1e-2,
    sides_doubt: 1e-2,
    sides_steps: 50,
    sides: 0.25,
    strays: 1e-2,
    mach_doubt: 0.3,
    creep: 2e-6,
    wall_depth: 0.5,
    rest: 1e-4,
};

/// Name of the check that no particle leaves through a wall.
pub(super) const WALL_DEPTH: &str = "wall_depth";

/// A watched invariant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Watch {
    pub name: &'static str,
    pub value: f64,
    /// The limit; None where the value is only shown.
    pub limit: Option<f64>,
    /// Whether a value beyond the limit has lasted long enough to end the run.
    pub is_lasting: bool,
    pub divergence: Divergence,
}

impl Watch {
    /// The check of the report.
    pub fn check(&self) -> Check {
        match self.limit {
            Some(limit) => {
                let check = Check::at_most(self.name, Some(self.value), limit, "");
                Check { holds: check.holds.map(|_| !self.is_broken()), ..check }
            }
            None => Check::watched(self.name, Some(self.value), ""),
        }
    }

    /// Whether the value is beyond its limit.
    pub fn is_broken(&self) -> bool {
        self.is_lasting && self.limit.is_some_and(|limit| self.value > limit)
    }
}

/// Values of the invariants at the last measurement; NaN where one is not known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Watched {
    pub energy: f64,
    pub momentum: f64,
    pub crowded: f64,
    pub area: f64,
    pub sides: f64,
    pub strays: f64,
    pub creep: f64,
    /// Steps in a row with particles on the wrong side.
    pub sides_steps: u64,
    /// Measurements in a row with crowded particles.
    pub crowded_measurements: u64,
    /// Whether there has been one drop all the time.
    pub is_single: bool,
}

/// What decides which limits apply.
#[derive(Debug, Clone, Copy)]
pub(super) struct Watching {
    /// Whether the budgets of the scheme close.
    pub closes: bool,
    /// Whether sides and area are known.
    pub has_level_set: bool,
    /// Whether particles are shifted.
    pub is_shifted: bool,
}

impl Watched {
    pub const UNKNOWN: Self = Self {
        energy: f64::NAN,
        momentum: f64::NAN,
        crowded: f64::NAN,
        area: f64::NAN,
        sides: f64::NAN,
        strays: f64::NAN,
        creep: f64::NAN,
        sides_steps: 0,
        crowded_measurements: 0,
        is_single: true,
    };

    /// The limit of the share of crowded particles.
    pub fn most_crowded(&self, is_shifted: bool) -> f64 {
        if self.is_single && !is_shifted { LIMITS.crowded } else { LIMITS.crowded_in_passing }
    }

    /// Whether particles have been on the wrong side for longer than a passage.
    pub fn sides_last(&self) -> bool {
        self.sides_steps > LIMITS.sides_steps
    }

    /// The invariants with their limits.
    pub fn watches(&self, Watching { closes, has_level_set, is_shifted }: Watching) -> Vec<Watch> {
        let closed = |limit: f64| closes.then_some(limit);
        // Most end a run at their first value beyond the limit.
        let watch = |name, value, limit, divergence| Watch { name, value, limit, divergence, is_lasting: true };
        let crowded_lasts = self.crowded_measurements >= LIMITS.crowded_measurements;
        let most_crowded = self.most_crowded(is_shifted);
        let crowded = watch("crowded_particles", self.crowded, Some(most_crowded), Divergence::Crowded);
        let mut watches = vec![
            watch("energy_gain", self.energy, closed(LIMITS.energy), Divergence::Energy),
            watch("momentum_gain", self.momentum, closed(LIMITS.momentum), Divergence::Momentum),
            Watch { is_lasting: crowded_lasts, ..crowded },
        ];
        if has_level_set {
            let area = closed(LIMITS.area).filter(|_| self.is_single);
            let sides = self.is_single.then_some(LIMITS.sides);
            let sides = watch("wrong_sides", self.sides, sides, Divergence::Unresolved);
            watches.extend([
                watch("area_change", self.area, area, Divergence::PhaseLost),
                Watch { is_lasting: self.sides_last(), ..sides },
                watch("lost_particles", self.strays, Some(LIMITS.strays), Divergence::PhaseLost),
                watch("creep", self.creep, None, Divergence::Energy),
            ]);
        }
        watches
    }
}

impl Component for Watched {
    fn save(&self, section: &mut Section) {
        for (name, value) in self.values() {
            section.put_optional(name, known(value));
        }
        section.put_count("sides_steps", self.sides_steps);
        section.put_count("crowded_measurements", self.crowded_measurements);
        section.put_count("is_single", u64::from(self.is_single));
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        let value = |name: &str| Ok::<f64, LoadError>(section.optional(name)?.unwrap_or(f64::NAN));
        Ok(Self {
            energy: value("energy")?,
            momentum: value("momentum")?,
            crowded: value("crowded")?,
            area: value("area")?,
            sides: value("sides")?,
            strays: value("strays")?,
            creep: value("creep")?,
            sides_steps: section.count("sides_steps")?,
            crowded_measurements: section.count("crowded_measurements")?,
            is_single: section.count("is_single")? == 1,
        })
    }
}

impl Watched {
    fn values(&self) -> [(&'static str, f64); 7] {
        [
            ("energy", self.energy),
            ("momentum", self.momentum),
            ("crowded", self.crowded),
            ("area", self.area),
            ("sides", self.sides),
            ("strays", self.strays),
            ("creep", self.creep),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::{Component, LIMITS, Section, Watched, Watching};

    fn watching(closes: bool) -> Watching {
        Watching { closes, has_level_set: true, is_shifted: false }
    }

    #[test]
    fn a_broken_invariant_is_found_only_where_it_has_a_limit() {
        let broken = |watched: Watched, closes: bool| {
            let broken = watched.watches(watching(closes)).into_iter().find(super::Watch::is_broken);
            broken.map(|watch| watch.name)
        };
        let good = Watched { energy: 1e-3, area: 1e-3, ..Watched::UNKNOWN };
        assert_eq!(broken(good, true), None);
        let gained = Watched { energy: 0.02, ..good };
        assert_eq!(broken(gained, true), Some("energy_gain"));
        assert_eq!(broken(gained, false), None);
        let grown = Watched { area: 0.02, ..good };
        assert_eq!(broken(grown, true), Some("area_change"));
        assert_eq!(broken(Watched { is_single: false, ..grown }, true), None, "drops merged");
        let crowded = Watched { crowded: 0.01, crowded_measurements: LIMITS.crowded_measurements, ..good };
        assert_eq!(broken(crowded, false), Some("crowded_particles"));
        let shifted = Watching { is_shifted: true, ..watching(false) };
        assert!(!crowded.watches(shifted).iter().any(super::Watch::is_broken), "shifting pulls pairs apart again");
        let turned = Watched { sides: 0.3, sides_steps: LIMITS.sides_steps, ..good };
        assert_eq!(broken(turned, false), None);
        assert_eq!(broken(Watched { sides_steps: LIMITS.sides_steps + 1, ..turned }, false), Some("wrong_sides"));
        let check =
            turned.watches(watching(false)).iter().map(super::Watch::check).find(|check| check.name == "wrong_sides");
        let check = check.unwrap();
        assert_eq!(
            (check.limit, check.holds),
            (Some(LIMITS.sides), Some(true)),
            "the limit is shown before it has lasted"
        );
    }

    #[test]
    fn watched_values_survive_a_round_trip() {
        let watched = Watched { energy: 1.0, sides_steps: 7, is_single: false, area: 2.0, ..Watched::UNKNOWN };
        let mut section = Section::default();
        watched.save(&mut section);
        let again = Watched::load(&section).unwrap();
        assert_eq!((again.energy, again.area, again.sides_steps, again.is_single), (1.0, 2.0, 7, false));
        assert!(again.momentum.is_nan());
    }
}
