//! What a problem on a surface is to the simulation that runs it.

use super::cloud::SurfaceCloud;
use super::formula_terms::MOST_SPECIES;
use super::method::{Operators, Use, Wanted};
use crate::geometry::Vector;
use crate::parallel::Interrupt;
use crate::simulation::{
    Check, Diagnostic, ErrorEntry, Finding, LoadError, Observables, Phases, Quantity, Section, StepError,
};
use crate::time::Clock;
use std::collections::BTreeMap;

/// What a step works with.
pub struct Tools<'a, const D: usize> {
    /// Points, normals and exact geometry of the surface.
    pub cloud: &'a SurfaceCloud<D>,
    /// The operators that the problem wanted.
    pub operators: &'a Operators,
    /// Asks to drop the step.
    pub interrupt: &'a Interrupt,
    /// CPU seconds by phase.
    pub phases: &'a mut Phases,
    /// Clock before the step.
    pub from: Clock,
    /// Clock after the step.
    pub to: Clock,
}

/// Fields by name, as many as there may be substances and without an allocation; an unused place has no values.
pub type Watched<'a> = [(&'static str, &'a [f64]); MOST_SPECIES];

/// Fields to be watched.
pub fn watch<'a, const N: usize>(fields: [(&'static str, &'a [f64]); N]) -> Watched<'a> {
    std::array::from_fn(|k| fields.get(k).copied().unwrap_or(("", &[])))
}

/// A problem: its unknowns, and how a step changes them.
pub trait Problem<const D: usize>: Send {
    /// Operators that it needs.
    fn wanted(&self) -> Vec<Wanted>;

    /// What it does with Δ_S.
    fn purpose(&self) -> Use {
        Use::Pointwise
    }

    /// Makes one step.
    ///
    /// # Errors
    /// [`StepError`].
    fn step(&mut self, tools: Tools<'_, D>) -> Result<(), StepError>;

    /// The fields that frames show beside the surface; their values are computed by [`Self::column`].
    fn columns(&self) -> Vec<&'static Quantity>;

    /// The values of a field at the points.
    fn column(&self, quantity: &Quantity, clock: Clock) -> Vec<f64>;

    /// The fields of vectors that frames show; their values are computed by [`Self::vector_column`].
    fn vector_columns(&self) -> Vec<&'static Quantity> {
        Vec::new()
    }

    /// The values of a field of vectors at the points of the cloud.
    fn vector_column(&self, _quantity: &Quantity, _cloud: &SurfaceCloud<D>) -> Vec<Vector<D>> {
        Vec::new()
    }

    /// The unknowns whose finiteness is watched, by name.
    fn watched(&self) -> Watched<'_>;

    /// Errors against what is known exactly.
    fn errors(&self, cloud: &SurfaceCloud<D>, clock: Clock) -> Vec<ErrorEntry>;

    /// Scalars of the series, `time` excepted.
    fn observables(&self, cloud: &SurfaceCloud<D>, clock: Clock) -> Observables;

    /// Everything that the future depends on.
    fn save(&self, section: &mut Section);

    /// Restores the values from a section.
    ///
    /// # Errors
    /// [`LoadError`]; nothing is changed then.
    fn load(&mut self, section: &Section) -> Result<(), LoadError>;

    /// The section that the arrays of a checkpoint of format 1 stand for.
    ///
    /// # Errors
    /// [`LoadError`].
    fn translate_format_1(&self, arrays: &Section) -> Result<Section, LoadError>;

    /// What it watches: bounds that end the run where they do not hold. `steps` are done.
    fn checks(&self, _steps: u64) -> Vec<Check> {
        Vec::new()
    }

    /// Doubts that the step just done left.
    fn findings(&self, _clock: Clock) -> Vec<Finding> {
        Vec::new()
    }

    /// What it counts of its own work.
    fn diagnostics(&self) -> Vec<Diagnostic> {
        Vec::new()
    }

    /// What choices came to.
    fn describe(&self, method: &mut BTreeMap<&'static str, String>);
}
