//! What a simulation says of itself: errors, stability, choices, findings.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One error against a reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ErrorEntry {
    /// What is compared: `phi`, `closest_point`, `normal`, `curvature`, `area`, `interface`, …
    pub quantity: String,
    /// `rms`, `max`, `mean`, `relative` or `absolute`.
    pub norm: String,
    /// The error.
    pub value: f64,
    /// Scene time.
    pub time: f64,
    /// What it is compared with.
    pub reference: String,
}

/// How sound a run looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Health {
    /// Whether all numbers are finite.
    pub finite: bool,
    /// Largest displacement of a particle in a step, in spacings.
    pub max_cfl: f64,
    /// Relative change of the enclosed measure, where it is known.
    pub volume_drift: Option<f64>,
    /// Fits and queries that needed a rescue.
    pub rescued_fits: u64,
}

/// What a simulation reports of its method; costs of the process are added by whoever runs it.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// Errors against exact answers.
    pub errors: Vec<ErrorEntry>,
    /// Soundness at the end.
    pub health: Health,
    /// Worst condition of a scaled regression matrix.
    pub worst_condition: f64,
    /// Rescues of fits: how, and how often.
    pub rescued_fits: BTreeMap<&'static str, u64>,
    /// Closest-point queries.
    pub newton: Newton,
    /// What automatic choices came to, and why.
    pub method: BTreeMap<&'static str, String>,
}

/// Statistics of the constrained Newton solves.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Newton {
    /// Queries.
    pub solves: u64,
    /// Iterations per query.
    pub iterations_mean: f64,
    /// Rescues: how, and how often.
    pub rescued: BTreeMap<&'static str, u64>,
}

/// A noteworthy event of the physics.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Short name, such as `rescued_much`.
    pub name: &'static str,
    /// A sentence with numbers.
    pub message: String,
    /// Scene time.
    pub time: f64,
}
