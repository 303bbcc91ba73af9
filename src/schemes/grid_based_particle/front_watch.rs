//! What a front watches about itself: its growth, and ends where it must be closed.

use crate::simulation::{Check, Divergence, LoadError, Section, StepError};
use crate::time::Clock;

/// Growth beyond which the foot points are taken to multiply, in multiples of what the motion does to the front. That is an
/// estimate for flows, and a bound where a front moves along its normal.
const EXPLOSION: f64 = 3.0;
/// Share of the foot points at open ends beyond which a closed front is taken for torn. The tip of the filament of the single
/// vortex has two ends, a share below .02 at any spacing that was tried.
const MOST_ENDS: f64 = 0.25;
/// Steps between two looks at the ends, and for which a front must be torn: a body that dies away has ends in its last few steps.
const STEPS_BETWEEN: u64 = 16;

/// The limits of a front, and what was found last.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrontWatch {
    most_growth: f64,
    /// Share of the foot points at open ends when it was last counted.
    ends: Option<f64>,
    /// The step since which it is torn.
    torn_since: Option<u64>,
}

impl FrontWatch {
    /// A watch of a front whose motion makes it at most so many times as large. `bound` is the exact bound of a law that has one.
    pub(super) fn new(bound: Option<f64>, stretch: f64) -> Self {
        Self { most_growth: bound.unwrap_or(EXPLOSION * stretch), ends: None, torn_since: None }
    }

    /// Whether the ends are to be looked for after a step.
    pub(super) fn is_look_due(step: u64) -> bool {
        step.is_multiple_of(STEPS_BETWEEN)
    }

    /// Fails where the front has grown far beyond what moves it.
    pub(super) fn look_at_growth(&self, growth: f64, Clock { step, time }: Clock) -> Result<(), StepError> {
        if growth <= self.most_growth {
            return Ok(());
        }
        let (check, divergence, limit) = ("front_growth", Divergence::Unresolved, self.most_growth);
        Err(StepError::CheckFailed { check, divergence, value: growth, limit, step, time })
    }

    /// Fails where a front that must stay closed has had too many ends for many steps.
    pub(super) fn look_at_ends(
        &mut self,
        ends: usize,
        foot_points: usize,
        Clock { step, time }: Clock,
    ) -> Result<(), StepError> {
        let value = ends as f64 / foot_points.max(1) as f64;
        self.ends = Some(value);
        self.torn_since = (value > MOST_ENDS).then(|| self.torn_since.unwrap_or(step));
        if self.torn_since.is_none_or(|since| step < since + STEPS_BETWEEN) {
            return Ok(());
        }
        let (check, divergence, limit) = ("open_ends", Divergence::Unresolved, MOST_ENDS);
        Err(StepError::CheckFailed { check, divergence, value, limit, step, time })
    }

    /// Saves what was found last.
    pub(super) fn save(&self, state: &mut Section) {
        if let Some(share) = self.ends {
            state.put_real("open_ends", share);
        }
        if let Some(step) = self.torn_since {
            state.put_count("torn_since", step);
        }
    }

    /// The same watch with what was found last in a state.
    pub(super) fn restored(self, state: &Section) -> Result<Self, LoadError> {
        let ends = state.has("open_ends").then(|| state.real("open_ends")).transpose()?;
        let torn_since = state.has("torn_since").then(|| state.count("torn_since")).transpose()?;
        Ok(Self { ends, torn_since, ..self })
    }

    /// Forgets the ends of a front that has vanished.
    pub(super) fn forget_ends(&mut self) {
        (self.ends, self.torn_since) = (None, None);
    }

    /// The checks, with the present growth.
    pub(super) fn checks(&self, growth: f64) -> Vec<Check> {
        let growth = if self.most_growth.is_finite() {
            Check::at_most("front_growth", Some(growth), self.most_growth, "")
        } else {
            Check::watched("front_growth", Some(growth), "")
        };
        vec![growth, Check::at_most("open_ends", self.ends, MOST_ENDS, "")]
    }
}

#[cfg(test)]
mod tests {
    use super::FrontWatch;
    use crate::simulation::{Section, StepError};
    use crate::time::Clock;

    #[test]
    fn fronts_that_multiply_or_tear_end_the_run() {
        let at = Clock { step: 3, time: 0.5 };
        let mut watch = FrontWatch::new(None, 2.0);
        assert!(watch.look_at_growth(5.9, at).is_ok());
        assert!(matches!(watch.look_at_growth(6.1, at), Err(StepError::CheckFailed { check: "front_growth", .. })));
        assert!(FrontWatch::new(Some(1.5), 2.0).look_at_growth(1.6, at).is_err());
        assert!(watch.look_at_ends(10, 100, at).is_ok());
        assert!(watch.look_at_ends(30, 100, at).is_ok(), "a body that dies away is torn for a few steps");
        let mut state = Section::default();
        watch.save(&mut state);
        let mut watch = FrontWatch::new(None, 2.0).restored(&state).unwrap();
        assert_eq!(watch.checks(1.0)[1].value, Some(0.3));
        assert!(watch.look_at_ends(30, 100, Clock { step: 18, ..at }).is_ok());
        let torn = watch.look_at_ends(30, 100, Clock { step: 19, ..at });
        assert!(matches!(torn, Err(StepError::CheckFailed { check: "open_ends", .. })));
        assert_eq!(watch.checks(1.0)[1].holds, Some(false));
    }
}
