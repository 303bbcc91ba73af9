//! What every simulation is, whatever its method: stepping, state, fields, observables, report, and the loop that
//! runs it under the eyes of observers.

pub mod components;
pub mod course;
pub mod fields;
pub mod finding;
pub mod format_1;
pub mod measures;
pub mod output_plan;
pub mod phases;
pub mod quantity;
pub mod report;
pub mod run;
pub mod section;

pub use course::Course;
pub use fields::{Field, FieldValues, Fields, Mark, Selection};
pub use finding::{Check, Divergence, Finding, Health, Severity};
pub use measures::{Measure, Measures, Probe, Reduction, Region};
pub use output_plan::OutputPlan;
pub use phases::{CpuClock, Phases};
pub use quantity::{Observables, Quantity};
pub use report::{Diagnostic, ErrorEntry, Report};
pub use run::{Observer, Request, RunError, run};
pub use section::{Component, Entry, LoadError, Section};

use crate::linear_algebra::SparseRows;
use crate::time::Clock;
use crate::time::integrators::PathError;

/// A running scene. Its future depends on the scene and [`Simulation::save`] alone.
pub trait Simulation: Send {
    /// Steps done, their costs, and what was noticed.
    fn course(&self) -> &Course;

    /// The same, to write.
    fn course_mut(&mut self) -> &mut Course;

    /// Step number and scene time.
    fn clock(&self) -> Clock {
        self.course().clock()
    }

    /// The clock at the end of the run.
    fn end(&self) -> Clock {
        self.course().end()
    }

    /// Whether the end is reached.
    fn is_finished(&self) -> bool {
        self.clock().step >= self.end().step
    }

    /// Makes exactly one step, without the measurements that are due after it.
    ///
    /// # Errors
    /// [`StepError`]; the simulation is then of no further use.
    fn advance(&mut self) -> Result<(), StepError>;

    /// Whether this state is to be measured against an exact answer before anything looks at it.
    fn is_measurement_due(&self) -> bool {
        false
    }

    /// Takes the measurements that are due. Nothing that the next step reads changes, so that a dropped measurement can be
    /// taken again.
    ///
    /// # Errors
    /// [`StepError`]; when it is interrupted, the simulation is as before.
    fn measure(&mut self) -> Result<(), StepError> {
        Ok(())
    }

    /// Makes one step and takes the measurements that are due after it.
    ///
    /// # Errors
    /// As [`Self::advance`] and [`Self::measure`].
    fn step(&mut self) -> Result<(), StepError> {
        self.advance()?;
        if self.is_measurement_due() { self.measure() } else { Ok(()) }
    }

    /// The declared scalars of this state: a row of the series.
    fn observables(&self) -> Observables;

    /// The selected fields of a frame, which alone are computed; a pure read.
    fn fields<'a>(&self, selection: Selection<'a>) -> Fields<'a>;

    /// Saves everything that the future depends on, component by component.
    fn save(&self, state: &mut Section);

    /// Goes on from the state of an earlier run of the same scene.
    ///
    /// # Errors
    /// [`LoadError`] when the state is of another scene; nothing is changed then.
    fn load(&mut self, state: &Section) -> Result<(), LoadError>;

    /// The state that the arrays of a checkpoint of format 1 stand for. `arrays` holds them by name, and `clock`.
    ///
    /// # Errors
    /// [`LoadError`]; without a reader for format 1, always.
    fn translate_format_1(&self, _arrays: &Section) -> Result<Section, LoadError> {
        Err(LoadError::Format1)
    }

    /// Errors against the exact answer, health, diagnostics, and what automatic choices came to.
    fn report(&self) -> Report;

    /// CPU seconds by phase so far; asked for at every checkpoint, so it computes nothing.
    fn phases(&self) -> &Phases {
        &self.course().phases
    }

    /// The invariants of this state.
    fn health(&self) -> Health;

    /// Number of particles.
    fn particle_count(&self) -> usize;

    /// The area or volume of a region that each point of a frame stands for, as its scene promises
    /// ([`crate::scene::Scene::regions`]); None of a region that the scene has not.
    fn weights(&self, _region: Region) -> Option<Vec<f64>> {
        None
    }

    /// Operators that a client may ask for as files, made where they are not there yet.
    ///
    /// # Errors
    /// [`StepError`] when they cannot be made.
    fn operators(&mut self) -> Result<Vec<NamedOperator<'_>>, StepError> {
        Ok(Vec::new())
    }

    /// What was noticed since the last call.
    fn take_findings(&mut self) -> Vec<Finding> {
        std::mem::take(&mut self.course_mut().findings)
    }
}

/// A linear operator on the fields of frames: row i gives its value at point i.
pub struct NamedOperator<'a> {
    /// Its name, as in file names.
    pub name: &'static str,
    /// The matrix.
    pub rows: &'a SparseRows,
    /// Areas of the points, where they are known.
    pub areas: Option<&'a [f64]>,
}

/// The state of a simulation.
#[must_use]
pub fn state_of(simulation: &dyn Simulation) -> Section {
    let mut state = Section::default();
    simulation.save(&mut state);
    state
}

/// Why a step could not be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StepError {
    /// The run was asked to drop the step.
    #[error("interrupted")]
    Interrupted,
    /// A value stopped being a number.
    #[error("{field} of particle {particle} is not finite at step {step}, time {time}")]
    NonFinite {
        /// Name of the field.
        field: &'static str,
        /// Index of the particle.
        particle: usize,
        /// Number of the step.
        step: u64,
        /// Scene time of the step.
        time: f64,
    },
    /// Something that was given has no value where it is needed.
    #[error("{reason}, at step {step}, time {time}")]
    Undefined {
        /// What has no value, and where.
        reason: String,
        /// Number of the step.
        step: u64,
        /// Scene time of the step.
        time: f64,
    },
    /// A particle is faster than sound: the fluid is no longer nearly incompressible.
    #[error(
        "particle {particle} moves at {speed:.4e}, faster than sound ({sound_speed}), at step {step}, time {time}; {}",
        advice(*.time_step, *.stable, .bound)
    )]
    TooFast {
        /// Index of the particle.
        particle: usize,
        /// Speed of the particle.
        speed: f64,
        /// That of sound in its fluid.
        sound_speed: f64,
        /// Time step Δt.
        time_step: f64,
        /// What the limits allow at usual speeds.
        stable: f64,
        /// Name of the limit that binds the step.
        bound: &'static str,
        /// Number of the step.
        step: u64,
        /// Scene time of the step.
        time: f64,
    },
    /// A step would have to be cut into more parts than makes sense.
    #[error(
        "at the speed {speed:.4e} the limits allow {stable:.3e} of a step of {time_step:.3e}, at step {step}, time {time}"
    )]
    TimeStepFloor {
        /// Largest speed of a particle.
        speed: f64,
        /// Time step Δt.
        time_step: f64,
        /// What the limits allow.
        stable: f64,
        /// Number of the step.
        step: u64,
        /// Scene time of the step.
        time: f64,
    },
    /// A system of equations has no solution that the method finds, or a tolerance cannot be kept.
    #[error("{reason}, at step {step}, time {time}")]
    Unsolved {
        /// What was tried, and what it left.
        reason: String,
        /// Number of the step.
        step: u64,
        /// Scene time of the step.
        time: f64,
    },
    /// An invariant that the scheme watches no longer holds.
    #[error("{check} is {value:.4e}, its limit is {limit:.4e}, at step {step}, time {time}")]
    CheckFailed {
        /// Name of the check.
        check: &'static str,
        /// Kind of the divergence.
        divergence: Divergence,
        /// Value of the check.
        value: f64,
        /// Limit of the value.
        limit: f64,
        /// Number of the step.
        step: u64,
        /// Scene time of the step.
        time: f64,
    },
    /// Something is finer than the particles resolve.
    #[error("{reason}, at step {step}, time {time}")]
    Unresolved {
        /// What was found, as the beginning of a sentence with numbers.
        reason: String,
        /// Number of the step.
        step: u64,
        /// Scene time of the step.
        time: f64,
    },
    /// The surface vanished: no particle has a neighbor of the other sign, or no fit reaches a zero.
    #[error("no sample particle is left on the interface at step {step}, time {time}")]
    InterfaceLost {
        /// Number of the step.
        step: u64,
        /// Scene time of the step.
        time: f64,
    },
}

/// What would have held.
fn advice(time_step: f64, stable: f64, bound: &str) -> String {
    if time_step > stable * 1.001 {
        return format!("the step was {time_step:.3e}, {bound} allows {stable:.3e}");
    }
    format!(
        "the step of {time_step:.3e} is within the limits ({bound} allows {stable:.3e}), so particles have crowded: a higher \
         speed of sound or a finer spacing is needed"
    )
}

impl StepError {
    /// The error of a step in which points could not be carried along.
    #[must_use]
    pub fn from_path(error: PathError, Clock { step, time }: Clock) -> Self {
        match error {
            PathError::Interrupted(_) => Self::Interrupted,
            PathError::Undefined(reason) => Self::Undefined { reason, step, time },
        }
    }
}

impl From<crate::parallel::Interrupted> for StepError {
    fn from(_: crate::parallel::Interrupted) -> Self {
        Self::Interrupted
    }
}
