//! What a problem on a surface is to the simulation that runs it.

use super::cloud::SurfaceCloud;
use super::method::{Operators, Wanted};
use crate::parallel::Interrupt;
use crate::simulation::{ErrorEntry, Observables, Phases, RestoreError, State, StepError};
use crate::time::Clock;
use std::collections::BTreeMap;

/// What a step works with.
pub struct Tools<'a, const D: usize> {
    /// The surface.
    pub cloud: &'a SurfaceCloud<D>,
    /// The operators that the problem wanted.
    pub operators: &'a Operators,
    /// Asks to drop the step.
    pub interrupt: &'a Interrupt,
    /// Costs.
    pub phases: &'a mut Phases,
    /// Before the step.
    pub from: Clock,
    /// After it.
    pub to: Clock,
}

/// Fields by name, no more than two and without an allocation; an unused place has no values.
pub type Watched<'a> = [(&'static str, &'a [f64]); 2];

/// A problem: its unknowns, and how a step changes them.
pub trait Problem<const D: usize>: Send {
    /// Operators that it needs.
    fn wanted(&self) -> Vec<Wanted>;

    /// One step.
    ///
    /// # Errors
    /// [`StepError`].
    fn step(&mut self, tools: Tools<'_, D>) -> Result<(), StepError>;

    /// What frames show beside the surface.
    fn columns(&self, clock: Clock) -> Vec<(&'static str, Vec<f64>)>;

    /// The unknowns whose finiteness is watched, by name.
    fn watched(&self) -> Watched<'_>;

    /// Errors against what is known exactly.
    fn errors(&self, cloud: &SurfaceCloud<D>, clock: Clock) -> Vec<ErrorEntry>;

    /// Scalars of the series, `time` excepted.
    fn observables(&self, cloud: &SurfaceCloud<D>, clock: Clock) -> Observables;

    /// Everything that the future depends on.
    fn save(&self, state: &mut State);

    /// Takes it back.
    ///
    /// # Errors
    /// [`RestoreError`]; nothing is changed then.
    fn load(&mut self, state: &State) -> Result<(), RestoreError>;

    /// What choices came to.
    fn describe(&self, method: &mut BTreeMap<&'static str, String>);
}
