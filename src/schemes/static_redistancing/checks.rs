//! What a redistancing watches: whether its answers agree with the particles that they are made of.

use crate::closest_point::{Coverage, Crossings};
use crate::simulation::{Check, Component, Finding, LoadError, Section, StepError};
use crate::time::Clock;

/// Limits of the checks. The README of the scene has the values of good and bad runs from which they were chosen.
struct Limits {
    /// Share of the points whose answer is the nearest sample itself, or that have none. Resolved surfaces have none but
    /// at the center of a ball: one in 4,000 points at most.
    unreached: f64,
    /// The same share that is a doubt.
    unreached_doubt: f64,
    /// Limit and doubt of the remeshing baseline: the interpolated level is rough, and the paper's cases reach 0.9 %.
    unreached_remeshed: f64,
    /// Share of the particles next to the surface without a sample. Corners lose a few; a surface that loses more has
    /// gaps.
    lost: f64,
    /// The same share that is a doubt.
    lost_doubt: f64,
    /// Distance, in spacings, by which a crossing is missed. Corners are rounded by a part of a spacing; a face that was
    /// lost is missed by more than one.
    missed: f64,
    /// The same distance that is a doubt.
    missed_doubt: f64,
    /// Share of the particles with a level of zero that do not lie between both sides. A corner has one; a level that
    /// is zero in a layer has most.
    one_sided: f64,
    /// Share of the particles next to the surface that are alone on their side of it. Tips of corners have a few.
    lone: f64,
    /// The same share that is a doubt.
    lone_doubt: f64,
}

const LIMITS: Limits = Limits {
    unreached: 1e-2,
    unreached_doubt: 1e-3,
    unreached_remeshed: 2e-2,
    lost: 0.1,
    lost_doubt: 0.03,
    missed: 0.6,
    missed_doubt: 0.35,
    one_sided: 0.1,
    lone: 0.08,
    lone_doubt: 0.02,
};

/// Values of the checks at the last redistancing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Watched {
    /// None before the first redistancing.
    pub unreached: Option<f64>,
    pub lost: Option<f64>,
    /// None where the points asked about are the nodes of a grid.
    pub missed: Option<f64>,
    pub one_sided: Option<f64>,
    pub lone: Option<f64>,
}

/// One value with its limits, and what it means.
struct Watch {
    name: &'static str,
    value: Option<f64>,
    doubt: f64,
    limit: f64,
    unit: &'static str,
    /// What a value beyond the limits means.
    meaning: fn(f64) -> String,
}

impl Watched {
    /// The values after a redistancing.
    pub fn new(coverage: Coverage, crossings: Option<Crossings>) -> Self {
        Self {
            unreached: Some(coverage.unreached_share()),
            lost: Some(coverage.lost_share()),
            missed: crossings.map(|crossings| crossings.missed),
            one_sided: crossings.map(|crossings| crossings.one_sided_share()),
            lone: crossings.map(|crossings| crossings.lone_share()),
        }
    }

    fn watches(&self) -> [Watch; 5] {
        let (doubt, limit) = match (self.missed, self.unreached) {
            (None, Some(_)) => (LIMITS.unreached_remeshed, LIMITS.unreached_remeshed),
            _ => (LIMITS.unreached_doubt, LIMITS.unreached),
        };
        [
            Watch {
                name: "one_sided_zeros",
                value: self.one_sided,
                doubt: 0.0,
                limit: LIMITS.one_sided,
                unit: "",
                meaning: |share| {
                    format!("{} of the particles with a level of zero do not lie between both signs", percent(share))
                },
            },
            Watch {
                name: "unreached_queries",
                value: self.unreached,
                doubt,
                limit,
                unit: "",
                meaning: |share| format!("no closest point was found for {} of the points", percent(share)),
            },
            Watch {
                name: "lost_samples",
                value: self.lost,
                doubt: LIMITS.lost_doubt,
                limit: LIMITS.lost,
                unit: "",
                meaning: |share| format!("{} of the particles next to the surface have no point of it", percent(share)),
            },
            Watch {
                name: "missed_crossing",
                value: self.missed,
                doubt: LIMITS.missed_doubt,
                limit: LIMITS.missed,
                unit: "h",
                meaning: |missed| {
                    format!("the level changes its sign {missed:.2} spacings away from the surface that was found")
                },
            },
            Watch {
                name: "lone_particles",
                value: self.lone,
                doubt: LIMITS.lone_doubt,
                limit: LIMITS.lone,
                unit: "",
                meaning: |share| {
                    format!("{} of the particles next to the surface are alone on their side of it", percent(share))
                },
            },
        ]
    }

    /// The checks of the report.
    pub fn checks(&self) -> Vec<Check> {
        self.watches()
            .into_iter()
            .map(|watch| Check::at_most(watch.name, watch.value, watch.limit, watch.unit))
            .collect()
    }

    /// Doubts about a redistancing that there were not `before`.
    ///
    /// # Errors
    /// [`StepError::Unresolved`] where a value is beyond its limit.
    pub fn judge(&self, before: &Self, Clock { step, time }: Clock) -> Result<Vec<Finding>, StepError> {
        let mut doubts = Vec::new();
        for (Watch { name, value, doubt, limit, meaning, .. }, before) in
            self.watches().into_iter().zip(before.watches())
        {
            let Some(value) = value else { continue };
            if value > limit {
                let meaning = meaning(value);
                let reason = format!("{meaning} ({name} is {value:.3e}, its limit {limit})");
                return Err(StepError::Unresolved { reason, step, time });
            }
            if value > doubt && before.value.is_none_or(|value| value <= doubt) {
                doubts.push(Finding::warning(name, meaning(value), (step, time)).with_advice(ADVICE));
            }
        }
        Ok(doubts)
    }
}

fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}

/// What may help where a surface is not resolved.
const ADVICE: &str = "particles of a smaller spacing resolve it";

impl Component for Watched {
    fn save(&self, section: &mut Section) {
        section.put_optional("unreached", self.unreached);
        section.put_optional("lost", self.lost);
        section.put_optional("missed", self.missed);
        section.put_optional("one_sided", self.one_sided);
        section.put_optional("lone", self.lone);
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        Ok(Self {
            unreached: section.optional("unreached")?,
            lost: section.optional("lost")?,
            missed: section.optional("missed")?,
            one_sided: section.optional("one_sided")?,
            // Checkpoints of earlier versions have none.
            lone: if section.has("lone") { section.optional("lone")? } else { None },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Clock, Component, Coverage, Crossings, LIMITS, Section, StepError, Watched};

    const AT: Clock = Clock { step: 2, time: 2.0 };

    #[test]
    fn good_values_pass_doubts_are_found_and_bad_values_end_the_run_with_a_sentence() {
        let coverage = Coverage { near: 100, lost: 0, asked: 10_000, by_sample: 1, out_of_reach: 0 };
        let good =
            Watched::new(coverage, Some(Crossings { zeros: 10, one_sided: 0, near: 100, lone: 1, missed: 1e-6 }));
        assert_eq!(good.judge(&Watched::default(), AT), Ok(Vec::new()));
        assert!(good.checks().iter().all(|check| check.holds == Some(true)));
        let doubtful = Watched { missed: Some(0.5 * (LIMITS.missed + LIMITS.missed_doubt)), ..good };
        assert_eq!(doubtful.judge(&good, AT).unwrap()[0].code, "missed_crossing");
        assert_eq!(doubtful.judge(&doubtful, AT), Ok(Vec::new()), "a doubt that lasts is one finding");
        let crossings = Some(Crossings::default());
        let bad = Watched::new(Coverage { by_sample: 1357, ..coverage }, crossings);
        let Err(error @ StepError::Unresolved { .. }) = bad.judge(&good, AT) else { panic!("a share of 14 % passed") };
        assert_eq!(
            error.to_string(),
            "no closest point was found for 13.57 % of the points (unreached_queries is 1.357e-1, its limit 0.01), at \
             step 2, time 2"
        );
        assert_eq!(bad.checks()[1].holds, Some(false));
        let layer = Watched::new(coverage, Some(Crossings { zeros: 10, one_sided: 4, ..Crossings::default() }));
        assert!(layer.judge(&good, AT).is_err());
    }

    #[test]
    fn watched_values_survive_a_round_trip() {
        let watched = Watched { unreached: Some(0.25), lost: Some(0.0), missed: None, one_sided: None, lone: None };
        let mut section = Section::default();
        watched.save(&mut section);
        assert_eq!(Watched::load(&section).unwrap(), watched);
    }
}
