//! What a study that refines does next, from what its levels have come to and nothing else: after a restart the answer is the same.

use crate::convergence::{Assessment, Convergence, Cost, Level, Subject, Target, assess};
use crate::spec::quantity::Quantity;
use crate::spec::states::Reason;
use crate::spec::study::{MeasuredLevel, RefineSpec, RefinementOutcome};

/// One of the set-ups that are compared.
#[derive(Debug, Clone, Default)]
pub struct Setup {
    /// What its levels have come to, the coarsest first.
    pub levels: Vec<MeasuredLevel>,
    /// Number of coarser levels that were passed over: a check ended the last of them.
    pub passed: usize,
    /// Why it cannot go on: a level failed, or does not fit into the memory.
    pub obstacle: Option<(RefinementOutcome, String)>,
}

impl Setup {
    /// Number of the level that follows.
    #[must_use]
    pub fn next_level(&self) -> usize {
        self.passed + self.levels.len()
    }

    /// Spacing of the first level that has come to something, by that of the first one.
    #[must_use]
    pub fn first_share(&self, ratio: f64) -> f64 {
        ratio.powf(-(self.passed as f64))
    }

    /// Spacing of the finest level, by that of the first one.
    #[must_use]
    pub fn finest_share(&self, ratio: f64) -> f64 {
        ratio.powf(1.0 - self.next_level().max(1) as f64)
    }

    /// A level that failed with a reason. Where a check ended it and few levels have come to something, these are too coarse to be
    /// judged: all so far are passed over, as long as enough are left. Otherwise it is in the way.
    pub fn pass_or_stop(&mut self, spec: &RefineSpec, reason: Option<Reason>, message: String) {
        let passed = self.next_level() + 1;
        let is_early = (self.levels.len() as u64) < spec.levels.least;
        let is_left = passed as u64 + spec.levels.least <= spec.levels.most;
        if is_early && is_left && reason.is_some_and(Reason::is_of_physics) {
            self.passed = passed;
            self.levels.clear();
        } else {
            self.obstacle = Some((RefinementOutcome::Failed, message));
        }
    }
}

/// The next step of a study.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// A level of a set-up is made.
    Make {
        /// Number of the set-up.
        setup: usize,
        /// Number of the level.
        level: usize,
    },
    /// One of several set-ups goes on, the others are stopped.
    Choose {
        /// Number of the set-up.
        setup: usize,
    },
    /// No further level is made.
    End {
        /// Why.
        outcome: RefinementOutcome,
        /// The same in a sentence, with numbers.
        message: String,
    },
}

/// The next step; `chosen` is the set-up that goes on, once it is chosen.
#[must_use]
pub fn next_step(spec: &RefineSpec, quantity: &Quantity, setups: &[Setup], chosen: Option<usize>) -> Step {
    let only = (setups.len() == 1).then_some(0);
    match chosen.or(only) {
        Some(setup) => go_on(spec, quantity, &setups[setup.min(setups.len() - 1)], setup),
        None => compare(spec, quantity, setups),
    }
}

/// The target of a set-up.
#[must_use]
pub fn target(spec: &RefineSpec, quantity: &Quantity, levels: &[MeasuredLevel]) -> Target {
    let finest = levels.last();
    Target {
        subject: if quantity.is_error() { Subject::Error } else { Subject::Value },
        theory: finest.and_then(|level| level.theory),
        tolerance: spec.until.tolerance,
        is_relative: spec.until.relative,
        scale: finest.map_or(1.0, |level| level.scale),
    }
}

/// What the levels of a set-up say.
#[must_use]
pub fn judge(spec: &RefineSpec, quantity: &Quantity, levels: &[MeasuredLevel]) -> Assessment {
    assess(&plain(levels), &target(spec, quantity, levels))
}

fn plain(levels: &[MeasuredLevel]) -> Vec<Level> {
    levels.iter().map(Level::from).collect()
}

/// The spacing of the level that would meet the tolerance, with its predicted CPU seconds.
#[must_use]
pub fn prediction(assessment: &Assessment, levels: &[MeasuredLevel]) -> Option<(f64, f64)> {
    let spacing = assessment.next_spacing?;
    Some((spacing, cost_at(levels, spacing)?))
}

/// Predicted CPU seconds of a set-up at a spacing.
fn cost_at(levels: &[MeasuredLevel], spacing: f64) -> Option<f64> {
    Some(Cost::new(&plain(levels))?.at(spacing))
}

/// What one level costs in advance: by what was run, and by the forecast corrected by the finest level, whichever is more.
#[must_use]
pub fn level_cost(levels: &[MeasuredLevel], spacing: f64, forecast_cpu_s: Option<f64>) -> Option<f64> {
    let fitted = cost_at(levels, spacing);
    let correction = levels.last().and_then(|finest| Some(finest.cpu_s / finest.forecast_cpu_s.filter(|s| *s > 0.0)?));
    let forecast = forecast_cpu_s.map(|seconds| seconds * correction.unwrap_or(1.0));
    match (fitted, forecast) {
        (Some(fitted), Some(forecast)) => Some(fitted.max(forecast)),
        (fitted, forecast) => fitted.or(forecast),
    }
}

/// The step of the one set-up that goes on.
fn go_on(spec: &RefineSpec, quantity: &Quantity, setup: &Setup, number: usize) -> Step {
    let levels = &setup.levels;
    let end = |outcome, message| Step::End { outcome, message };
    let make = Step::Make { setup: number, level: setup.next_level() };
    let is_judged = levels.len() as u64 >= spec.levels.least;
    let judged = judge(spec, quantity, levels);
    if is_judged && judged.is_met {
        let message = format!("{} is within the tolerance {:.2e}", said(quantity, &judged), spec.until.tolerance);
        return end(RefinementOutcome::Tolerance, message);
    }
    if let Some((outcome, message)) = &setup.obstacle {
        return end(*outcome, message.clone());
    }
    if !is_judged {
        return make;
    }
    let count = levels.len();
    if setup.next_level() as u64 >= spec.levels.most {
        let message = format!(
            "the {} levels that were allowed do not meet the tolerance: {}",
            spec.levels.most,
            said(quantity, &judged)
        );
        return end(RefinementOutcome::Levels, message);
    }
    // Coarse levels may be far from what leads in the end: a verdict needs one level more.
    let is_divergent = |judged: &Assessment| judged.convergence == Some(Convergence::Divergent);
    let before = judge(spec, quantity, &levels[..count - 1]);
    if count as u64 > spec.levels.least && count > 3 && is_divergent(&judged) && is_divergent(&before) {
        let message = format!("the last four levels of {} do not converge", quantity.label());
        return end(RefinementOutcome::Divergent, message);
    }
    make
}

/// The uncertainty, in words.
fn said(quantity: &Quantity, judged: &Assessment) -> String {
    match judged.uncertainty {
        Some(uncertainty) if quantity.is_error() => format!("the error {uncertainty:.2e}"),
        Some(uncertainty) => format!("the grid convergence index {uncertainty:.2e}"),
        None => "no error can be told".to_owned(),
    }
}

/// The step of several set-ups: first the coarse levels of all, level by level, then the choice.
fn compare(spec: &RefineSpec, quantity: &Quantity, setups: &[Setup]) -> Step {
    let left = || setups.iter().enumerate().filter(|(_, setup)| setup.obstacle.is_none());
    let least = spec.levels.least as usize;
    let is_short = |(_, setup): &(usize, &Setup)| setup.levels.len() < least;
    let shortest = left().filter(is_short).min_by_key(|(_, setup)| setup.next_level());
    match shortest {
        None if left().next().is_none() => {
            let causes = setups.iter().filter_map(|setup| setup.obstacle.as_ref());
            let messages: Vec<&str> = causes.clone().map(|(_, message)| message.as_str()).collect();
            let outcome = causes.map(|(outcome, _)| *outcome).next().unwrap_or(RefinementOutcome::Failed);
            Step::End { outcome, message: format!("no alternative is left: {}", messages.join("; ")) }
        }
        Some((number, setup)) => Step::Make { setup: number, level: setup.next_level() },
        None => Step::Choose { setup: cheapest(spec, quantity, setups) },
    }
}

/// CPU seconds at which a set-up is predicted to meet the tolerance, on a level that it may have; those of its finest level where
/// that meets it.
#[must_use]
pub fn predicted_cpu_s(spec: &RefineSpec, quantity: &Quantity, levels: &[MeasuredLevel]) -> Option<f64> {
    let judged = judge(spec, quantity, levels);
    if judged.is_met {
        return levels.last().map(|finest| finest.cpu_s);
    }
    prediction(&judged, levels).map(|(_, cpu_s)| cpu_s)
}

/// The set-up that is predicted to meet the tolerance at the least cost; where none is, the one with the least error.
fn cheapest(spec: &RefineSpec, quantity: &Quantity, setups: &[Setup]) -> usize {
    let least = spec.ratio.powf(1.0 - spec.levels.most as f64);
    let rank = |setup: &Setup| {
        let judged = judge(spec, quantity, &setup.levels);
        let finest_possible = setup.levels.first().map_or(0.0, |first| first.spacing * least);
        let is_within_reach =
            judged.is_met || judged.next_spacing.is_some_and(|spacing| spacing >= 0.99 * finest_possible);
        let cost = predicted_cpu_s(spec, quantity, &setup.levels).filter(|_| is_within_reach);
        (cost.unwrap_or(f64::INFINITY), judged.uncertainty.unwrap_or(f64::INFINITY))
    };
    let ranked = setups.iter().enumerate().filter(|(_, setup)| setup.obstacle.is_none());
    let best = ranked
        .map(|(number, setup)| (number, rank(setup)))
        .min_by(|(_, a), (_, b)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    best.map_or(0, |(number, _)| number)
}

#[cfg(test)]
mod tests {
    use super::{Setup, Step, level_cost, next_step};
    use crate::spec::quantity::Quantity;
    use crate::spec::states::Reason;
    use crate::spec::study::{MeasuredLevel, RefineSpec, RefinementOutcome};
    use meniscus::spec::Parameter;
    use serde_json::{Value, json};

    fn spec(changes: &[(&str, Value)]) -> RefineSpec {
        let mut given = json!({"axis": "/scene/spacing", "from": 0.1, "ratio": 2.0, "quantity": {"report": "/x"},
            "until": {"tolerance": 1e-3}, "levels": {"least": 3, "most": 6}});
        for (name, value) in changes {
            given[*name] = value.clone();
        }
        RefineSpec::parse(&given, (), "", &mut Vec::new()).unwrap()
    }

    fn level(spacing: f64, value: f64) -> MeasuredLevel {
        MeasuredLevel {
            spacing,
            value,
            scale: 1.0,
            theory: None,
            cpu_s: 1e-3 * spacing.powi(-2),
            forecast_cpu_s: None,
            wall_s: 0.0,
            particles: 0,
            steps: 0,
            health: None,
        }
    }

    fn error() -> Quantity {
        Quantity::Error { quantity: "phi".to_owned(), norm: "rms".to_owned(), time: None }
    }

    fn setup(count: i32, value: impl Fn(f64) -> f64) -> Setup {
        let spacings = (0..count).map(|k| 0.1 / 2.0_f64.powi(k));
        Setup { levels: spacings.map(|h| level(h, value(h))).collect(), ..Setup::default() }
    }

    /// How many levels are made of one set-up, and the word of the end.
    fn run(spec: &RefineSpec, quantity: &Quantity, value: impl Fn(f64) -> f64) -> (i32, RefinementOutcome) {
        for count in 0..20 {
            match next_step(spec, quantity, &[setup(count, &value)], None) {
                Step::Make { setup: 0, level } => assert_eq!(level, count as usize),
                Step::End { outcome, message } => {
                    assert!(!message.is_empty());
                    return (count, outcome);
                }
                other => panic!("{other:?}"),
            }
        }
        panic!("no end");
    }

    #[test]
    fn levels_are_made_until_the_tolerance_is_met_and_no_further() {
        assert_eq!(run(&spec(&[]), &error(), |h| h * h), (3, RefinementOutcome::Tolerance), "as many as are asked for");
        assert_eq!(run(&spec(&[]), &error(), |h| 4.0 * h * h), (4, RefinementOutcome::Tolerance));
        assert_eq!(run(&spec(&[]), &error(), |h| h), (6, RefinementOutcome::Levels));
        let value = Quantity::Report { pointer: "/x".to_owned() };
        assert_eq!(
            run(&spec(&[]), &value, |h| 7.0 + 1.5 * h * h),
            (4, RefinementOutcome::Tolerance),
            "the index is 1.25 times the error"
        );
        assert_eq!(run(&spec(&[]), &value, f64::ln), (4, RefinementOutcome::Divergent));
        assert_eq!(run(&spec(&[]), &error(), |h| 1.0 / h), (4, RefinementOutcome::Divergent));
        let relative = spec(&[("until", json!({"tolerance": 1e-3, "relative": true}))]);
        assert_eq!(run(&relative, &value, |h| 1000.0 + h), (3, RefinementOutcome::Tolerance));
    }

    #[test]
    fn of_several_set_ups_the_cheapest_that_reaches_the_tolerance_goes_on() {
        let spec = spec(&[("alternatives", json!({"/scene/method/degree": [1, 2, 3]}))]);
        let whole =
            |count| [setup(count, |h| h), setup(count, |h| 10.0 * h.powi(2)), setup(count, |h| 10.0 * h.powi(3))];
        let mut setups = whole(0);
        for level in 0..3 {
            for number in 0..3 {
                assert_eq!(next_step(&spec, &error(), &setups, None), Step::Make { setup: number, level });
                setups[number].levels = whole(level as i32 + 1)[number].levels.clone();
            }
        }
        assert_eq!(next_step(&spec, &error(), &setups, None), Step::Choose { setup: 2 });
        setups[2].obstacle = Some((RefinementOutcome::Failed, "level 2 failed".to_owned()));
        assert_eq!(next_step(&spec, &error(), &setups, None), Step::Choose { setup: 1 });
        assert_eq!(next_step(&spec, &error(), &setups, Some(1)), Step::Make { setup: 1, level: 3 });
        for setup in &mut setups {
            setup.obstacle = Some((RefinementOutcome::Memory, "too large".to_owned()));
        }
        let Step::End { outcome, message } = next_step(&spec, &error(), &setups, None) else { panic!() };
        assert_eq!(outcome, RefinementOutcome::Memory);
        assert!(message.contains("too large"));
    }

    #[test]
    fn what_stands_in_the_way_ends_a_study_unless_it_is_met_already() {
        let obstacle = Some((RefinementOutcome::Failed, "level 1 failed: diverged".to_owned()));
        let stopped = Setup { obstacle: obstacle.clone(), ..setup(1, |h| h) };
        assert!(matches!(next_step(&spec(&[]), &error(), &[stopped], None),
            Step::End { outcome: RefinementOutcome::Failed, message } if message.contains("diverged")));
        let met = Setup { obstacle, ..setup(4, |h| h.powi(3)) };
        assert!(matches!(
            next_step(&spec(&[]), &error(), &[met], None),
            Step::End { outcome: RefinementOutcome::Tolerance, .. }
        ));
    }

    #[test]
    fn first_levels_that_a_check_ends_are_passed_over_as_long_as_enough_are_left() {
        let spec = spec(&[]);
        let mut passed = Setup::default();
        for level in 1..=3 {
            passed.pass_or_stop(&spec, Some(Reason::DivergedUnresolved), "too coarse".to_owned());
            assert!(passed.obstacle.is_none());
            assert_eq!(next_step(&spec, &error(), &[passed.clone()], None), Step::Make { setup: 0, level });
        }
        let mut measured = Setup { levels: setup(3, |h| h).levels, ..passed.clone() };
        let end = next_step(&spec, &error(), &[measured.clone()], None);
        assert!(matches!(end, Step::End { outcome: RefinementOutcome::Levels, .. }), "all six are made: {end:?}");
        passed.pass_or_stop(&spec, Some(Reason::DivergedUnresolved), "too coarse".to_owned());
        assert!(passed.obstacle.is_some(), "three of the six are needed");
        measured.pass_or_stop(&spec, Some(Reason::DivergedUnresolved), "level 6".to_owned());
        assert!(measured.obstacle.is_some(), "enough levels have come to something");
        let mut lucky = setup(1, |h| h);
        lucky.pass_or_stop(&spec, Some(Reason::DivergedUnresolved), "level 1".to_owned());
        assert_eq!((lucky.passed, lucky.levels.len()), (2, 0), "a level coarser than one that failed is not judged");
        let mut crashed = Setup::default();
        crashed.pass_or_stop(&spec, Some(Reason::WorkerCrash), "crashed".to_owned());
        assert!(crashed.obstacle.is_some());
    }

    #[test]
    fn the_cost_of_a_level_is_the_larger_of_fit_and_corrected_forecast() {
        let levels = setup(3, |h| h).levels;
        let fitted = level_cost(&levels, 0.0125, None).unwrap();
        assert!((fitted - 1e-3 * 0.0125_f64.powi(-2)).abs() < 1e-6);
        assert!((level_cost(&levels, 0.0125, Some(50.0)).unwrap() - 50.0).abs() < 1e-9);
        let corrected = MeasuredLevel { forecast_cpu_s: Some(0.1), ..levels[2].clone() };
        let found = level_cost(&[corrected], 0.0125, Some(1.0)).unwrap();
        assert!((found - levels[2].cpu_s / 0.1).abs() < 1e-9, "{found}");
        assert_eq!(level_cost(&[], 0.1, None), None);
    }
}
