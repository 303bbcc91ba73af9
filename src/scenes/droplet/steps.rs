//! The time step of a scene.

use super::spec::Droplet;
use crate::schemes::weakly_compressible_sph::SphConfig;
use crate::schemes::weakly_compressible_sph::time_step::{StepLimit, longest_step};
use crate::spec::Violation;
use serde_json::Value;

/// The time step, the number of steps, and what binds the step.
pub(super) fn time_step<const D: usize>(
    spec: &Droplet,
    config: &SphConfig<D>,
    given_step: Option<f64>,
    errors: &mut Vec<Violation>,
) -> (f64, u64, &'static str) {
    if let (Some(step), Some(_)) = (spec.time_step, spec.steps) {
        let detail = "steps are given instead of a time step; give one of them";
        errors.push(Violation::new("/time_step", "conflict", detail, step, Value::Null));
    }
    let StepLimit { length: limit, cause: bound } = longest_step(config, config.expected_speed);
    let time_step = match (given_step, spec.steps) {
        (Some(step), _) => step,
        (None, Some(steps)) => spec.end_time / steps as f64,
        // The last step lands on the end.
        (None, None) => spec.end_time / (spec.end_time / limit).ceil(),
    };
    let steps = (spec.end_time / time_step - 1e-9).ceil();
    if !(time_step.is_normal() && (1.0..=1e9).contains(&steps)) {
        let detail = "the run would have too many steps or none";
        let allowed = format!("a number from {:e} to {:e}", spec.end_time * 1e-9, spec.end_time);
        errors.push(Violation::new("/time_step", "range", detail, time_step, allowed));
    }
    (time_step, steps as u64, bound)
}
