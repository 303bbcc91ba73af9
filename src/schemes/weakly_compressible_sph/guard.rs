//! The guard of a run: budgets of energy and momentum, watched invariants, and the warnings that it issues.

use super::budget::{Budget, Contents};
use super::checks::{LIMITS, Watch, Watched, Watching};
use super::config::{Discretization, Integrator};
use super::droplets::ball_curvature;
use super::energy_rise::EnergyRise;
use super::interactions::TensionForce;
use super::species::Species;
use super::system::SphSystem;
use super::walls::Container;
use crate::geometry::Vector;
use crate::schemes::measured_errors::entry;
use crate::simulation::section::known;
use crate::simulation::{Check, ErrorEntry, Finding, LoadError, Section, Severity, StepError};
use crate::time::Clock;

/// What comes in from outside, and the power of surface tension, at one moment.
#[derive(Debug, Clone, Copy)]
struct Supply<const D: usize> {
    power: f64,
    force: Vector<D>,
    tension_power: f64,
}

impl<const D: usize> Supply<D> {
    fn new(system: &SphSystem<D>, time: f64) -> Self {
        let (power, force) = system.body_force_sums(time);
        Self { power, force, tension_power: system.tension_power() }
    }
}

/// Codes of the doubts; each is issued once a run.
const DOUBTS: [&str; 7] =
    ["energy_gain", "crowded_particles", "fast_flow", "wrong_sides", "level_creeps", "shape_unresolved", "strays_left"];

/// What a run watches of itself.
#[derive(Debug)]
pub(super) struct Guard<const D: usize> {
    pub budget: Budget<D>,
    /// Of the energy gained, by the surface energy at the start.
    pub rise: EnergyRise,
    watched: Watched,
    /// At the end of the last part of a step.
    supply: Supply<D>,
    /// Particles of the drops at the start.
    start_particles: usize,
    /// Time at which the drop came to rest, and the work of surface tension with the surface energy then; NaN in motion.
    rest: [f64; 2],
    /// Whether each of [`DOUBTS`] was issued.
    issued: [bool; DOUBTS.len()],
}

/// Σ m |u| below which speeds are round-off of the pressures: that of 1e-6 of the least speed of sound.
fn least_momentum<const D: usize>(system: &SphSystem<D>) -> f64 {
    let mass: f64 = (0..system.flow.count()).map(|i| system.flow.mass(i)).sum();
    1e-6 * system.config.fluids.least_sound_speed() * mass
}

impl<const D: usize> Guard<D> {
    /// The guard of a run that starts from the present state.
    pub fn new(system: &SphSystem<D>) -> Self {
        let is_single = system.droplets.number() == 1 && !system.droplets.has_layer();
        Self {
            budget: Budget::new(&system.contents()),
            rise: EnergyRise::NONE,
            watched: Watched { is_single, ..Watched::UNKNOWN },
            supply: Supply::new(system, 0.0),
            start_particles: system.flow.species.iter().filter(|species| **species == Species::Inside).count(),
            rest: [f64::NAN; 2],
            issued: [false; DOUBTS.len()],
        }
    }

    /// Adds what came in during a part of a step that ends now, by the trapezoidal rule. `is_changed` says whether the number of
    /// droplets changed in it.
    pub fn advance(&mut self, system: &SphSystem<D>, time: f64, length: f64, is_changed: bool) {
        let (before, now) = (self.supply, Supply::new(system, time));
        self.budget.work += 0.5 * length * (before.power + now.power);
        self.budget.impulse += (before.force + now.force) * (0.5 * length);
        self.budget.tension_work += 0.5 * length * (before.tension_power + now.tension_power);
        self.supply = now;
        self.watched.is_single &= !is_changed;
    }

    /// Counts a whole step with or without particles on the wrong side.
    pub fn count_step(&mut self, system: &SphSystem<D>) {
        let is_wrong = system.interface.level_set().is_some_and(|set| set.sides.wrong_share() > LIMITS.sides_doubt);
        self.watched.sides_steps = if is_wrong { self.watched.sides_steps + 1 } else { 0 };
    }

    /// Measures the watched invariants. `crowded` is the share of particles that are too close to another, `measure` the
    /// enclosed area or volume.
    ///
    /// # Errors
    /// [`StepError::CheckFailed`] where an invariant is broken.
    pub fn measure(
        &mut self,
        system: &SphSystem<D>,
        contents: &Contents<D>,
        (crowded, measure): (f64, f64),
        Clock { step, time }: Clock,
    ) -> Result<(), StepError> {
        let scale = system.config.tension * self.budget.start_interface;
        let lost = system.strays.lost.unsigned_abs() as f64 / self.start_particles.max(1) as f64;
        if self.budget.start_measure.is_nan() {
            self.budget.start_measure = measure;
        }
        let creep = self.creep(system, contents, time);
        self.watched = Watched {
            energy: self.budget.gain(contents) / scale,
            momentum: self.budget.momentum_gain(contents) / contents.momentum_size.max(least_momentum(system)),
            crowded,
            area: (measure / self.budget.start_measure - 1.0).abs(),
            sides: system.interface.level_set().map_or(f64::NAN, |set| set.sides.wrong_share()),
            strays: lost,
            creep,
            crowded_measurements: if crowded > self.watched.most_crowded(system.config.is_shifted) {
                self.watched.crowded_measurements + 1
            } else {
                0
            },
            ..self.watched
        };
        self.rise.take(self.watched.energy);
        let broken = self.watches(system).into_iter().find(Watch::is_broken);
        broken.map_or(Ok(()), |Watch { name, value, limit, divergence, .. }| {
            let limit = limit.unwrap_or(f64::NAN);
            Err(StepError::CheckFailed { check: name, divergence, value, limit, step, time })
        })
    }

    /// The largest rise of the energy by the surface energy at the start, where the budget closes.
    pub fn energy_rise(&self, system: &SphSystem<D>, time: f64) -> Option<ErrorEntry> {
        let reference = "its largest value before, by the surface energy at the start";
        self.closes(system).then(|| entry("total_energy", "rise", self.rise.largest, time, reference))
    }

    /// Work of surface tension since the drop came to rest, beyond that of the shrinking interface, in a capillary time
    /// √(ρR³/τ) by the surface energy at the start; NaN in motion, and for the first capillary time of rest.
    fn creep(&mut self, system: &SphSystem<D>, contents: &Contents<D>, time: f64) -> f64 {
        let is_sheared = system.config.mean_shear.is_some();
        if system.varying.is_some() || system.droplets.has_contact() || is_sheared {
            // A slope works, a surfactant spreads, and so does a drop on a wall; a shear draws drops out.
            return f64::NAN;
        }
        let tension = system.config.tension;
        let scale = tension * self.budget.start_interface;
        let radius = (D - 1) as f64 / ball_curvature::<D>(system.droplets.initial_measure);
        let capillary = (system.config.fluids.inside.density * radius.powi(3) / tension).sqrt();
        let kinetic = contents.inner_kinetic();
        if kinetic > LIMITS.rest * scale || kinetic <= 0.0 {
            self.rest = [f64::NAN; 2];
            return f64::NAN;
        }
        let balance = self.budget.tension_work + contents.surface;
        let [since, balance_then] = self.rest;
        if since.is_nan() {
            self.rest = [time, balance];
        }
        let elapsed = time - since;
        if elapsed > capillary { (balance - balance_then).abs() / scale * capillary / elapsed } else { f64::NAN }
    }

    /// Whether the budgets of energy and momentum close but for the scheme's errors.
    fn closes(&self, system: &SphSystem<D>) -> bool {
        let config = &system.config;
        config.tension_force == TensionForce::Balanced
            && system.interface.level_set().is_some()
            && !config.is_density_integrated()
            && config.discretization == Discretization::Kernels
            // A line that rests between two angles has no energy.
            && !config.container.iter().flat_map(Container::walls).any(|wall| wall.contact.has_hysteresis())
            // The impulse of another integrator is not the trapezoidal rule.
            && config.integrator == Integrator::KickDriftKick
            // Between walls and in shear shifts are so small that budgets close all the same.
            && (!config.is_shifted || config.container.is_some() || config.mean_shear.is_some())
    }

    fn watches(&self, system: &SphSystem<D>) -> Vec<Watch> {
        let has_level_set = system.interface.level_set().is_some();
        let is_shifted = system.config.is_shifted;
        self.watched.watches(Watching { closes: self.closes(system), has_level_set, is_shifted })
    }

    /// The checks of the report.
    pub fn checks(&self, system: &SphSystem<D>) -> Vec<Check> {
        self.watches(system).iter().map(Watch::check).collect()
    }

    /// Warnings of the last measurement that were not issued before. `mach` is the largest Mach number.
    pub fn new_doubts(&mut self, system: &SphSystem<D>, mach: f64, Clock { step, time }: Clock) -> Vec<Finding> {
        let mut findings = Vec::new();
        for (k, (is_so, message, advice)) in self.doubts(system, mach).into_iter().enumerate() {
            if is_so && !self.issued[k] {
                self.issued[k] = true;
                let doubt = Finding::warning(DOUBTS[k], message, (step, time)).with_advice(advice);
                // A creeping level is a hint; the budget of energy says when it matters.
                let severity = if DOUBTS[k] == "level_creeps" { Severity::Info } else { Severity::Warning };
                findings.push(Finding { severity, ..doubt });
            }
        }
        findings
    }

    /// Whether each of [`DOUBTS`] is there, its message and what helps.
    fn doubts(&self, system: &SphSystem<D>, mach: f64) -> [(bool, String, &'static str); DOUBTS.len()] {
        let watched = self.watched;
        let has_limit = self.watches(system).iter().any(|watch| watch.name == DOUBTS[0] && watch.limit.is_some());
        let percent = |share: f64| 100.0 * share;
        let unresolved = (self.budget.start_measure / system.droplets.initial_measure - 1.0).abs();
        [
            (
                has_limit && watched.energy > LIMITS.energy_doubt,
                format!("the energy budget does not close: {:.2e} of the surface energy appeared", watched.energy),
                "a finer spacing or a smaller time step helps",
            ),
            (
                watched.crowded > 0.0,
                format!(
                    "{:.2} % of the particles are closer than {} h to another",
                    percent(watched.crowded),
                    LIMITS.pair_distance
                ),
                "where drops merge this passes; otherwise a smaller time step or a higher speed of sound helps",
            ),
            (
                mach > LIMITS.mach_doubt,
                format!("the largest Mach number is {mach:.2}, so the fluids are compressed"),
                "a higher speed of sound helps",
            ),
            (
                watched.sides > LIMITS.sides_doubt && watched.sides_last(),
                format!(
                    "{:.1} % of the particles next to the interface lie on its wrong side by the fits",
                    percent(watched.sides)
                ),
                "where drops merge or part this passes; otherwise a finer spacing helps",
            ),
            (
                has_limit && watched.creep > LIMITS.creep,
                format!(
                    "surface tension works at rest: {:.1e} of the surface energy in a capillary time, so the level creeps",
                    watched.creep
                ),
                "redistancing transparent and a curvature filter keep it still",
            ),
            (
                unresolved > LIMITS.area,
                format!(
                    "at the start {:.1} % of the area or volume are missing in the fits or too much",
                    percent(unresolved)
                ),
                "a finer spacing resolves the shape",
            ),
            (
                system.strays.waiting > 0,
                format!(
                    "{} particles have no neighbor of their own fluid and stay, since a drop may not lose more",
                    system.strays.waiting
                ),
                "a finer spacing resolves the neck",
            ),
        ]
    }

    /// Saves everything that later checks depend on.
    pub fn save(&self, section: &mut Section) {
        section.put_component("budget", &self.budget);
        section.put_component("energy_rise", &self.rise);
        section.put_component("watched", &self.watched);
        section.put_counts("issued", self.issued.map(u64::from));
        section.put_optional("rest_since", known(self.rest[0]));
        section.put_optional("rest_balance", known(self.rest[1]));
        section.put_real("power", self.supply.power);
        section.put_vectors("force", &[self.supply.force]);
        section.put_real("tension_power", self.supply.tension_power);
    }

    /// The guard of a state that was saved.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn load(&self, section: &Section) -> Result<Self, LoadError> {
        let issued = section.counts_of("issued", DOUBTS.len())?;
        let mut budget: Budget<D> = section.component("budget")?;
        if budget.start_surface.is_nan() {
            // Earlier versions had one tension everywhere.
            budget.start_surface = budget.start_interface * (self.budget.start_surface / self.budget.start_interface);
        }
        Ok(Self {
            budget,
            // Version 0.2.0 did not measure it.
            rise: if section.has("energy_rise") { section.component("energy_rise")? } else { EnergyRise::NONE },
            watched: section.component("watched")?,
            supply: Supply {
                power: section.real("power")?,
                force: Vector::<D>::from_column_slice(section.reals_of("force", D)?),
                tension_power: section.real("tension_power")?,
            },
            start_particles: self.start_particles,
            rest: [
                section.optional("rest_since")?.unwrap_or(f64::NAN),
                section.optional("rest_balance")?.unwrap_or(f64::NAN),
            ],
            issued: std::array::from_fn(|k| issued[k] == 1),
        })
    }
}
