//! The loop that drives a simulation: observe, step, observe, … until the end or a request to stop.

use super::{Simulation, StepError};

/// What an observer may ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// The run goes on.
    Continue,
    /// End the loop here, after this whole step, also where it is the last one.
    Stop,
}

/// Looks at a simulation after every step (and before the first), never touches it.
pub trait Observer {
    /// Called with the state after a step. Errors end the run.
    ///
    /// # Errors
    /// Whatever keeps the observer from its work, such as a full disk.
    fn observe(&mut self, simulation: &dyn Simulation) -> Result<Request, ObserverError>;

    /// Called with a state that is about to be measured, which may take long.
    ///
    /// # Errors
    /// As [`Self::observe`].
    fn before_measurement(&mut self, _simulation: &dyn Simulation) -> Result<Request, ObserverError> {
        Ok(Request::Continue)
    }

    /// Called with noteworthy physics of the last step.
    ///
    /// # Errors
    /// As [`Self::observe`].
    fn notice(&mut self, _finding: &super::Finding) -> Result<(), ObserverError> {
        Ok(())
    }
}

/// Any failure of an observer.
pub type ObserverError = Box<dyn std::error::Error + Send + Sync>;

/// Why a run ended early.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A step failed.
    #[error(transparent)]
    Step(#[from] StepError),
    /// An observer failed.
    #[error("{0}")]
    Observer(ObserverError),
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// The end of the scene.
    Finished,
    /// An observer asked to stop.
    Stopped,
}

/// Runs to the end of the scene or until an observer asks to stop; the first look comes before the first step.
///
/// # Errors
/// [`RunError`].
pub fn run(simulation: &mut dyn Simulation, observer: &mut dyn Observer) -> Result<Ending, RunError> {
    loop {
        if simulation.is_measurement_due() {
            if observer.before_measurement(simulation).map_err(RunError::Observer)? == Request::Stop {
                return Ok(Ending::Stopped);
            }
            simulation.measure()?;
        }
        for finding in simulation.take_findings() {
            observer.notice(&finding).map_err(RunError::Observer)?;
        }
        let request = observer.observe(simulation).map_err(RunError::Observer)?;
        if request == Request::Stop {
            return Ok(Ending::Stopped);
        }
        if simulation.is_finished() {
            return Ok(Ending::Finished);
        }
        simulation.advance()?;
    }
}
