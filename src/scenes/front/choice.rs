//! The parameters of a front as every kind of scene gives them, and what they become.

use super::spec::Law;
use crate::scenes::gbpm_spec::{GbpmPlan, GbpmSpec, TopologyWord};
use crate::scenes::shapes::Shape;
use crate::time::{FixedStep, PathIntegrator};
use serde_json::Value;

/// Parameters of a front.
pub(in crate::scenes) struct FrontChoice {
    pub law: Law,
    pub shape: Shape,
    pub spacing: f64,
    pub end_time: f64,
    pub time_step: Option<f64>,
    pub steps: Option<u64>,
    pub integrator: PathIntegrator,
    pub method: GbpmSpec,
    /// None where the scene has no choice: segments merge.
    pub topology: Option<TopologyWord>,
    /// JSON pointer to the parameters of the method.
    pub pointer: &'static str,
}

impl FrontChoice {
    /// Where its flow stands: where the motion of another scene is done as a front, at the top.
    pub fn flow_pointer(&self) -> &'static str {
        if self.pointer.is_empty() { "/law/flow" } else { "/flow" }
    }
}

/// What was left open in a [`FrontChoice`].
pub(in crate::scenes) struct Completed {
    pub dimension: usize,
    pub time_step: f64,
    pub method: GbpmSpec,
}

/// The kind of a scene and its resolved parameters.
pub(super) type Resolved = (&'static str, Value);

/// The plan of a front.
pub(super) struct FrontPlan {
    pub resolved: Resolved,
    pub chosen: GbpmPlan,
    pub fixed: FixedStep,
}
