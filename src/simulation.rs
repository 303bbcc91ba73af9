//! What every simulation is, whatever its method: stepping, state, fields, observables, report, and the loop that
//! runs it under the eyes of observers.

pub mod fields;
pub mod output_plan;
pub mod phases;
pub mod report;
pub mod run;
pub mod state;

pub use fields::{Field, FieldValues, Fields};
pub use output_plan::OutputPlan;
pub use phases::{CpuClock, Phases};
pub use report::{ErrorEntry, Finding, Health, Report};
pub use run::{Observer, Request, RunError, run};
pub use state::{RestoreError, State};

use crate::time::Clock;

/// Named scalars of one moment, in a fixed order.
pub type Observables = Vec<(&'static str, f64)>;

/// A running scene. Its future depends on the scene and [`Simulation::state`] alone.
pub trait Simulation: Send {
    /// Step number and scene time.
    fn clock(&self) -> Clock;

    /// The clock at the end of the run.
    fn end(&self) -> Clock;

    /// Whether the end is reached.
    fn is_finished(&self) -> bool {
        self.clock().step >= self.end().step
    }

    /// Exactly one step.
    ///
    /// # Errors
    /// [`StepError`]; the simulation is then of no further use.
    fn step(&mut self) -> Result<(), StepError>;

    /// A few named scalars: a row of the series.
    fn observables(&self) -> Observables;

    /// What a frame shows, computed only when asked; a pure read.
    fn fields(&self) -> Fields;

    /// Everything that the future depends on, no more.
    fn state(&self) -> State;

    /// Takes the place of an earlier run of the same scene.
    ///
    /// # Errors
    /// [`RestoreError`] when the state is of another scene; nothing is changed then.
    fn restore(&mut self, state: &State) -> Result<(), RestoreError>;

    /// Errors against the exact answer, stability, and what automatic choices came to.
    fn report(&self) -> Report;

    /// CPU seconds by phase so far; asked for at every checkpoint, so it computes nothing.
    fn phases(&self) -> &Phases;

    /// A short look at soundness.
    fn health(&self) -> Health;

    /// How many particles there are.
    fn particle_count(&self) -> usize;

    /// Noteworthy physics since the last call.
    fn take_findings(&mut self) -> Vec<Finding>;
}

/// Why a step could not be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StepError {
    /// Somebody asked to drop the step.
    #[error("interrupted")]
    Interrupted,
    /// A value stopped being a number.
    #[error("{field} of particle {particle} is not finite at step {step}, time {time}")]
    NonFinite {
        /// Which field.
        field: &'static str,
        /// Which particle.
        particle: usize,
        /// In which step.
        step: u64,
        /// At what time.
        time: f64,
    },
    /// A particle is faster than sound: the fluid is no longer nearly incompressible.
    #[error(
        "particle {particle} moves at {speed:.4e}, faster than sound ({sound_speed}), at step {step}, time {time}; {}",
        advice(*.time_step, *.stable, .bound)
    )]
    TooFast {
        /// Which particle.
        particle: usize,
        /// Its speed.
        speed: f64,
        /// That of sound in its fluid.
        sound_speed: f64,
        /// Δt.
        time_step: f64,
        /// What the limits allow at usual speeds.
        stable: f64,
        /// What binds them.
        bound: &'static str,
        /// In which step.
        step: u64,
        /// At what time.
        time: f64,
    },
    /// A step would have to be cut into more parts than makes sense.
    #[error(
        "at the speed {speed:.4e} the limits allow {stable:.3e} of a step of {time_step:.3e}, at step {step}, time {time}"
    )]
    TimeStepFloor {
        /// The largest speed.
        speed: f64,
        /// Δt.
        time_step: f64,
        /// What the limits allow.
        stable: f64,
        /// In which step.
        step: u64,
        /// At what time.
        time: f64,
    },
    /// A system of equations has no solution that the method finds, or a tolerance cannot be kept.
    #[error("{reason}, at step {step}, time {time}")]
    Unsolved {
        /// What was tried, and what it left.
        reason: String,
        /// In which step.
        step: u64,
        /// At what time.
        time: f64,
    },
    /// The surface vanished: no particle has a neighbour of the other sign, or no fit reaches a zero.
    #[error("no sample particle is left on the interface at step {step}, time {time}")]
    InterfaceLost {
        /// In which step.
        step: u64,
        /// At what time.
        time: f64,
    },
}

/// What would have held.
fn advice(time_step: f64, stable: f64, bound: &str) -> String {
    if time_step > stable * 1.001 {
        return format!("the step was {time_step:.3e}, {bound} allows {stable:.3e}");
    }
    format!(
        "the step of {time_step:.3e} is within the limits ({bound} allows {stable:.3e}), so particles have crowded: shifting, a \
         higher speed of sound or a finer spacing is needed"
    )
}

impl From<crate::parallel::Interrupted> for StepError {
    fn from(_: crate::parallel::Interrupted) -> Self {
        Self::Interrupted
    }
}
