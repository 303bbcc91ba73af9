//! Studies that refine, without the service: what they do next, and which spacing their levels tell.
//!
//! Everything here follows from a study's spec and from what its levels have come to. The service runs the levels as jobs, the
//! verification runs them in its own process.

pub mod decision;
pub mod for_accuracy;
pub mod short_runs;
pub mod spacing;

use crate::spec::quantity::Quantity;
use crate::spec::study::{RefineSpec, Sweep, SweepPoint};
use meniscus::spec::{Json, Parameter};

/// The levels of a study, ready to be made.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The levels as declared.
    pub spec: RefineSpec,
    /// What is judged.
    pub quantity: Quantity,
    /// The set-ups that are compared.
    pub setups: Vec<SweepPoint>,
}

impl Plan {
    /// The plan of a sweep over a base; None where it does not refine, or where this version of the program does not understand it.
    #[must_use]
    pub fn new(sweep: &Json, base: &Json) -> Option<Self> {
        let Some(Sweep::Refine { refine: spec }) = Sweep::parse(sweep, (), "/sweep", &mut Vec::new()) else {
            return None;
        };
        let quantity = spec.judged(base, &mut Vec::new())?;
        let setups = spec.setups();
        Some(Self { spec, quantity, setups })
    }
}
