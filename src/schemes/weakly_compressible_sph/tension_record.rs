//! What a run shows and watches of a tension that varies: amounts of the surfactant, ranges of coverage and tension.

use super::checks::Watch;
use super::migration::Migration;
use super::quantities::{COVERAGE_MAX, COVERAGE_MIN, SURFACTANT, SURFACTANT_OFF_INTERFACE, TENSION_MAX, TENSION_MIN};
use super::surfactant::Amounts;
use super::system::SphSystem;
use super::varying_tension::VaryingTension;
use crate::geometry::Vector;
use crate::schemes::measured_errors::entry;
use crate::simulation::course::check_finite;
use crate::simulation::section::known;
use crate::simulation::{Check, Divergence, ErrorEntry, Finding, LoadError, Observables, Section, StepError};
use crate::time::Clock;

/// Limits of what is watched.
struct Limits {
    /// Relative change of the amount of surfactant: its exchange is in pairs, so only rounding changes it.
    drift: f64,
    /// Fall of the tension below that of the clean interface: the law does not hold up to nothing, and a drop without tension breaks.
    fall: f64,
    /// Largest coverage: an interface that is full has no law, and Langmuir's tension falls without bound.
    coverage: f64,
    /// Coverage below nothing: the filter of the coverage may overshoot next to a sharp edge of it.
    below_nothing: f64,
    /// Part of the interface that knows no tension, and so feels none.
    unknown: f64,
    /// Nearness of the band to the jump of a slope at a side of the box.
    jump: f64,
    /// Share of the surfactant on particles that left the interface which is a doubt.
    left_doubt: f64,
}

const LIMITS: Limits = Limits {
    drift: 1e-10,
    fall: 0.95,
    coverage: 0.99,
    below_nothing: 0.05,
    unknown: 1e-3,
    jump: 1.0,
    left_doubt: 1e-3,
};

/// The numbers of the last measured state.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TensionRecord<const D: usize> {
    /// Amount of surfactant at the start; NaN before the first measurement, and without any.
    start: f64,
    /// Amount, and share of it off the interface; NaN without a surfactant.
    total: f64,
    off_interface: f64,
    /// Least and largest coverage; NaN without a surfactant.
    coverage: [f64; 2],
    /// Least and largest tension by τ₀.
    tension: [f64; 2],
    nearness_to_jump: f64,
    unknown_share: f64,
    has_surfactant: bool,
    migration: Migration<D>,
    /// Whether the doubt about what left the interface was issued.
    is_left_issued: bool,
}

impl<const D: usize> TensionRecord<D> {
    /// Nothing measured yet of a run to an end.
    pub fn new(has_surfactant: bool, end: f64) -> Self {
        Self {
            start: f64::NAN,
            total: f64::NAN,
            off_interface: f64::NAN,
            coverage: [f64::NAN; 2],
            tension: [f64::NAN; 2],
            nearness_to_jump: f64::NAN,
            unknown_share: f64::NAN,
            has_surfactant,
            migration: Migration::new(end),
            is_left_issued: false,
        }
    }

    /// Takes what the series shows of a state.
    pub fn take(&mut self, system: &SphSystem<D>, varying: &VaryingTension<D>) {
        self.find_ranges(system, varying);
        if let Some(Amounts { total, off_interface }) = varying.amounts(&system.particles) {
            if self.start.is_nan() {
                self.start = total;
            }
            self.total = total;
            self.off_interface = if total == 0.0 { 0.0 } else { off_interface / total };
        }
    }

    /// Watches the state that was taken, with the center of what is inside.
    ///
    /// # Errors
    /// [`StepError::CheckFailed`] where an invariant is broken.
    pub fn measure(
        &mut self,
        system: &SphSystem<D>,
        center: &Vector<D>,
        Clock { step, time }: Clock,
    ) -> Result<Option<Finding>, StepError> {
        self.migration.take(system, center, time);
        self.check(step, time)?;
        if self.is_left_issued || self.off_interface.is_nan() || self.off_interface <= LIMITS.left_doubt {
            return Ok(None);
        }
        self.is_left_issued = true;
        let message = format!("{:.2} % of the surfactant are far from any interface", 100.0 * self.off_interface);
        let doubt = Finding::warning("surfactant_left", message, (step, time));
        Ok(Some(doubt.with_advice("it stays on the particles that carried it where drops merge or fragments vanish")))
    }

    /// # Errors
    /// [`StepError::CheckFailed`] where an invariant is broken.
    fn check(&self, step: u64, time: f64) -> Result<(), StepError> {
        let broken = self.watches().into_iter().find(Watch::is_broken);
        broken.map_or(Ok(()), |Watch { name, value, limit, divergence, .. }| {
            let limit = limit.unwrap_or(f64::NAN);
            Err(StepError::CheckFailed { check: name, divergence, value, limit, step, time })
        })
    }

    /// Watches the state after a step.
    ///
    /// # Errors
    /// [`StepError::CheckFailed`] where an invariant is broken.
    pub fn check_step(
        &mut self,
        system: &SphSystem<D>,
        varying: &VaryingTension<D>,
        Clock { step, time }: Clock,
    ) -> Result<(), StepError> {
        check_finite("surfactant", varying.all_amounts(&system.particles), Clock { step, time })?;
        self.find_ranges(system, varying);
        self.check(step, time)
    }

    fn find_ranges(&mut self, system: &SphSystem<D>, varying: &VaryingTension<D>) {
        self.tension = varying.tension_range();
        self.unknown_share = varying.field.unknown_share;
        self.nearness_to_jump = varying.nearness_to_jump(&system.particles, &system.columns);
        self.coverage = varying.coverage_range().unwrap_or([f64::NAN; 2]);
    }

    fn watches(&self) -> Vec<Watch> {
        let watch = |name, value, limit, divergence| Watch { name, value, limit, divergence, is_lasting: true };
        let fall = watch("tension_fall", 1.0 - self.tension[0], Some(LIMITS.fall), Divergence::Unsolved);
        if !self.has_surfactant {
            let jump = self.nearness_to_jump;
            return vec![fall, watch("nearness_to_tension_jump", jump, Some(LIMITS.jump), Divergence::Escaped)];
        }
        let [least, most] = self.coverage;
        vec![
            watch("tension_unknown", self.unknown_share, Some(LIMITS.unknown), Divergence::Unresolved),
            watch("coverage_most", most, Some(LIMITS.coverage), Divergence::Unsolved),
            watch("coverage_below_nothing", (-least).max(0.0), Some(LIMITS.below_nothing), Divergence::Unsolved),
            fall,
            watch("surfactant_drift", self.drift(), Some(LIMITS.drift), Divergence::Unsolved),
        ]
    }

    /// Relative change of the amount of surfactant since the start; 0 where there was none.
    fn drift(&self) -> f64 {
        if self.start == 0.0 && self.total == 0.0 { 0.0 } else { (self.total / self.start - 1.0).abs() }
    }

    /// Errors against theory, and what was lost or gained of the surfactant, at a time.
    pub fn errors(&self, system: &SphSystem<D>, measure: f64, time: f64) -> Vec<ErrorEntry> {
        let drift = self.has_surfactant.then(|| entry("surfactant", "relative", self.drift(), time, "conservation"));
        self.migration.error(system, measure).into_iter().chain(drift).collect()
    }

    /// The checks of the report.
    pub fn checks(&self) -> Vec<Check> {
        self.watches().iter().map(Watch::check).collect()
    }

    /// What the series shows.
    pub fn observables(&self) -> Observables {
        let mut row: Observables = vec![(&TENSION_MIN, self.tension[0]), (&TENSION_MAX, self.tension[1])];
        if self.has_surfactant {
            row.extend([
                (&SURFACTANT, self.total),
                (&SURFACTANT_OFF_INTERFACE, self.off_interface),
                (&COVERAGE_MIN, self.coverage[0]),
                (&COVERAGE_MAX, self.coverage[1]),
            ]);
        }
        row
    }

    /// Saves what later rows and checks depend on.
    pub fn save(&self, section: &mut Section) {
        for (name, value) in self.names() {
            section.put_optional(name, known(value));
        }
        section.put_section("migration", |section| self.migration.save(section));
        section.put_count("is_issued", u64::from(self.is_left_issued));
    }

    fn names(&self) -> [(&'static str, f64); 9] {
        [
            ("start", self.start),
            ("total", self.total),
            ("off_interface", self.off_interface),
            ("least_coverage", self.coverage[0]),
            ("largest_coverage", self.coverage[1]),
            ("least_tension", self.tension[0]),
            ("largest_tension", self.tension[1]),
            ("nearness_to_jump", self.nearness_to_jump),
            ("unknown_share", self.unknown_share),
        ]
    }

    /// The record of a state that was saved.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn load(&self, section: &Section) -> Result<Self, LoadError> {
        let value = |name: &str| Ok::<f64, LoadError>(section.optional(name)?.unwrap_or(f64::NAN));
        Ok(Self {
            start: value("start")?,
            total: value("total")?,
            off_interface: value("off_interface")?,
            coverage: [value("least_coverage")?, value("largest_coverage")?],
            tension: [value("least_tension")?, value("largest_tension")?],
            nearness_to_jump: value("nearness_to_jump")?,
            unknown_share: value("unknown_share")?,
            has_surfactant: self.has_surfactant,
            migration: section.section("migration", |section| self.migration.load(section))?,
            is_left_issued: section.count("is_issued")? == 1,
        })
    }
}
