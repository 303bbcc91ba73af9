//! Watches the enclosed area or volume in a flow without divergence, which keeps it.
//!
//! The value is the quadrature over the surface that the fits reach. Where a filament is thinner than the particles resolve,
//! the surface that they give is none.

use crate::simulation::{Check, Finding, LoadError, Section, StepError};
use crate::time::Clock;

/// Relative change beyond which a run ends. The paper's method at its coarsest spacing, 1/64, changes the area of the single
/// vortex by .49 at most; at 1/32 it is .62, and 2.7 with a dual field at half the time.
const MOST: f64 = 0.6;
/// Relative change beyond which the results are doubtful. The automatic methods stay below .12 at 1/64.
const DOUBTFUL: f64 = 0.2;

/// The watch of a run.
#[derive(Debug, Default)]
pub(super) struct EnclosedWatch {
    /// Whether a doubt was told.
    is_told: bool,
}

/// Name of the check in D dimensions.
fn name<const D: usize>() -> &'static str {
    if D == 2 { "area_drift" } else { "volume_drift" }
}

/// The check of a relative change; a flow with divergence has no limit.
pub(super) fn check<const D: usize>(drift: Option<f64>, is_kept: bool) -> Check {
    if is_kept {
        Check::at_most(name::<D>(), drift.map(f64::abs), MOST, "")
    } else {
        Check::watched(name::<D>(), drift, "")
    }
}

impl EnclosedWatch {
    /// Looks at a relative change that was just measured. The first large one is told.
    pub(super) fn look<const D: usize>(
        &mut self,
        drift: f64,
        Clock { step, time }: Clock,
    ) -> Result<Option<Finding>, StepError> {
        let value = drift.abs();
        let what = if D == 2 { "area" } else { "volume" };
        let message = format!(
            "the enclosed {what} has changed by {:.1} %, though the flow keeps it: the surface is finer than the particles resolve",
            100.0 * drift
        );
        if value > MOST {
            let reason = format!("{message} ({} is {value:.3}, its limit {MOST})", name::<D>());
            return Err(StepError::Unresolved { reason, step, time });
        }
        if value <= DOUBTFUL || self.is_told {
            return Ok(None);
        }
        self.is_told = true;
        let advice = "a smaller spacing resolves thinner filaments";
        Ok(Some(Finding::warning(name::<D>(), message, (step, time)).with_advice(advice)))
    }

    /// Saves what was told.
    pub(super) fn save(&self, state: &mut Section) {
        state.put_count("enclosed_doubt_told", u64::from(self.is_told));
    }

    /// What was told up to a state; earlier versions told nothing.
    pub(super) fn load(state: &Section) -> Result<Self, LoadError> {
        let is_told = state.has("enclosed_doubt_told") && state.count("enclosed_doubt_told")? > 0;
        Ok(Self { is_told })
    }
}

#[cfg(test)]
mod tests {
    use super::{EnclosedWatch, check};
    use crate::simulation::{Section, StepError};
    use crate::time::Clock;

    #[test]
    fn a_doubt_is_told_once_and_nonsense_ends_the_run() {
        let at = Clock { step: 3, time: 0.5 };
        let mut watch = EnclosedWatch::default();
        assert_eq!(watch.look::<2>(-0.1, at).unwrap(), None);
        let told = watch.look::<2>(0.3, at).unwrap().unwrap();
        assert!(told.message.contains("30.0 %") && told.message.contains("area"), "{told}");
        let mut state = Section::default();
        watch.save(&mut state);
        assert_eq!(EnclosedWatch::load(&state).unwrap().look::<2>(0.4, at).unwrap(), None);
        assert!(matches!(watch.look::<3>(-2.7, at), Err(StepError::Unresolved { .. })));
        assert_eq!(check::<2>(Some(-2.7), true).holds, Some(false));
        assert_eq!(check::<2>(Some(-2.7), false).holds, None);
    }
}
