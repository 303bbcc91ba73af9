//! When frames and series rows are due. A scene sees the plan, so that what a frame needs and what changes state (a
//! redistancing) happens inside the step that ends at the frame.

use crate::time::FixedStep;
use crate::time::clock::TIME_SLACK;

/// When output is wanted, in scene time and steps. The first and the last state are always due.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutputPlan {
    /// A frame at every multiple of this time; None means first and last only.
    pub every_time: Option<f64>,
    /// A series row at every multiple of this number of steps.
    pub series_every_steps: u64,
}

impl OutputPlan {
    /// Whether a frame is due after `step`: the first step with t ≥ a due time, up to 1e-9 of a step.
    #[must_use]
    pub fn is_frame_due(&self, fixed: &FixedStep, step: u64) -> bool {
        if step == 0 || step >= fixed.steps {
            return true;
        }
        let passed = |n: u64| {
            let time = (n as f64 + TIME_SLACK) * fixed.time_step;
            self.every_time.map_or(0.0, |every| (time / every).floor())
        };
        passed(step) > passed(step - 1)
    }

    /// Whether a series row is due after `step`.
    #[must_use]
    pub fn is_series_due(&self, fixed: &FixedStep, step: u64) -> bool {
        step == 0 || step >= fixed.steps || step.is_multiple_of(self.series_every_steps.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::{FixedStep, OutputPlan};

    #[test]
    fn frames_fall_on_their_times_once_each() {
        let fixed = FixedStep::from_steps(8.0, 240);
        let due = |every| {
            let plan = OutputPlan { every_time: every, series_every_steps: 10 };
            (0..=240).filter(|&n| plan.is_frame_due(&fixed, n)).collect::<Vec<u64>>()
        };
        assert_eq!(due(None), [0, 240]);
        assert_eq!(due(Some(4.0)), [0, 120, 240]);
        assert_eq!(due(Some(3.0)), [0, 90, 180, 240]);
        assert_eq!(due(Some(0.001)).len(), 241);
    }
}
