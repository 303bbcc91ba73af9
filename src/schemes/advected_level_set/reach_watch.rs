//! Watches how far the answers of redistancings can be trusted: particles whose closest point is a mere sample, and particles
//! next to the surface without a point of it.

use crate::closest_point::Coverage;
use crate::simulation::{Check, Finding, LoadError, Section, StepError};
use crate::time::Clock;

/// A share with its limits.
struct Limits {
    name: &'static str,
    /// Value that is a doubt.
    doubt: f64,
    /// Value that ends the run.
    most: f64,
    /// What the share is of, in a message.
    meaning: &'static str,
}

/// Where a filament is thinner than the particles resolve, its tip has no closest points. The paper's method has .22 at h = 1/64, and
/// the automatic one .08 at 1/64 and .23 at 1/48.
const BY_SAMPLE: Limits = Limits {
    name: "answers_by_sample",
    doubt: 0.3,
    most: 0.5,
    meaning: "of the particles in the band have no closest point but the nearest sample",
};

/// Samples that fits lose are the ends of filaments. The paper's method has .26 at h = 1/64.
const LOST: Limits = Limits {
    name: "lost_samples",
    doubt: 0.35,
    most: 0.5,
    meaning: "of the particles next to the surface have no point of it",
};

/// The largest shares of a run so far.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct ReachWatch {
    by_sample: Option<f64>,
    lost: Option<f64>,
}

impl ReachWatch {
    /// Looks at a redistancing. A share that becomes doubtful is told once.
    pub(super) fn look(&mut self, coverage: Coverage, now: Clock) -> Result<Vec<Finding>, StepError> {
        let answered = (coverage.asked - coverage.out_of_reach).max(1);
        let by_sample = coverage.by_sample as f64 / answered as f64;
        let mut findings = Vec::new();
        for (limits, largest, value) in
            [(BY_SAMPLE, &mut self.by_sample, by_sample), (LOST, &mut self.lost, coverage.lost_share())]
        {
            let before = largest.unwrap_or(0.0);
            *largest = Some(before.max(value));
            findings.extend(judge(&limits, before, value, now)?);
        }
        Ok(findings)
    }

    /// The checks of the report.
    pub(super) fn checks(&self) -> [Check; 2] {
        let check = |limits: Limits, value| Check::at_most(limits.name, value, limits.most, "");
        [check(BY_SAMPLE, self.by_sample), check(LOST, self.lost)]
    }

    /// Saves the shares that there are.
    pub(super) fn save(&self, state: &mut Section) {
        for (limits, share) in [(BY_SAMPLE, self.by_sample), (LOST, self.lost)] {
            if let Some(share) = share {
                state.put_real(limits.name, share);
            }
        }
    }

    /// The shares of a state; earlier versions have none.
    pub(super) fn load(state: &Section) -> Result<Self, LoadError> {
        let share = |name| state.has(name).then(|| state.real(name)).transpose();
        Ok(Self { by_sample: share(BY_SAMPLE.name)?, lost: share(LOST.name)? })
    }
}

fn judge(limits: &Limits, before: f64, value: f64, Clock { step, time }: Clock) -> Result<Option<Finding>, StepError> {
    let Limits { name, doubt, most, meaning } = limits;
    if value <= *doubt {
        return Ok(None);
    }
    let message = format!("{:.1} % {meaning}", 100.0 * value);
    if value > *most {
        let reason = format!("{message} ({name} is {value:.3}, its limit {most})");
        return Err(StepError::Unresolved { reason, step, time });
    }
    let advice = "a smaller spacing resolves thinner filaments";
    Ok((before <= *doubt).then(|| Finding::warning(name, message, (step, time)).with_advice(advice)))
}

#[cfg(test)]
mod tests {
    use super::ReachWatch;
    use crate::closest_point::Coverage;
    use crate::simulation::{Section, StepError};
    use crate::time::Clock;

    #[test]
    fn a_doubt_is_told_once_and_answers_of_samples_alone_end_the_run() {
        let at = Clock { step: 3, time: 0.5 };
        let good = Coverage { near: 100, lost: 1, asked: 1000, by_sample: 5, out_of_reach: 500 };
        let mut watch = ReachWatch::default();
        assert_eq!(watch.look(good, at).unwrap(), []);
        let doubtful = Coverage { by_sample: 200, ..good };
        let told = watch.look(doubtful, at).unwrap();
        assert!(told.len() == 1 && told[0].message.starts_with("40.0 %"), "{told:?}");
        let mut state = Section::default();
        watch.save(&mut state);
        let mut again = ReachWatch::load(&state).unwrap();
        assert_eq!((again, again.look(doubtful, at).unwrap()), (watch, Vec::new()));
        let lost = Coverage { lost: 60, ..good };
        let Err(error @ StepError::Unresolved { .. }) = watch.look(lost, at) else { panic!("60 % passed") };
        assert!(error.to_string().contains("60.0 % of the particles next to the surface"), "{error}");
    }
}
