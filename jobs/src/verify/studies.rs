//! Runs the cases of studies: what the service does for a job that asks for an accuracy, in this process.

use super::case::Bound;
use super::outcome::Outcome;
use super::study_case::{Part, StudyCase, Trial, Trials};
use super::workspace::Workspace;
use crate::convergence::{Level, Subject, Target, assess};
use crate::formats::measured_level;
use crate::refinement::decision::{Setup, Step, judge, next_step};
use crate::refinement::short_runs::{self, Curves};
use crate::refinement::spacing::tell;
use crate::refinement::{Plan, for_accuracy};
use crate::spec::body::{self, Allowance, JobBody, NoSources};
use crate::spec::study::{MeasuredLevel, RefinementOutcome, SweepPoint, point_body};
use crate::system::process;
use crate::worker::local_run::{Ended, Keep};
use serde_json::{Value, json};

/// Orders agree with theory within so much.
const ORDER_TOLERANCE: f64 = 0.2;
/// Share of trials that must meet their tolerance.
const LEAST_SHARE: f64 = 0.9;
/// Cost by that of the best set-up found by hand at most.
const MOST_COST: f64 = 2.0;
/// Ratio of two spacings that are tried by hand.
const HAND_RATIO: f64 = 1.12;
/// Errors by the tolerance above which a set-up is given up: the spacing that it needs is far away.
const HOPELESS: f64 = 20.0;
/// CPU seconds below which a run is timed more than once: the least time counts, of the service's runs and of those by hand.
const SHORT_S: f64 = 0.3;
/// How often a short run is timed again.
const AGAIN: usize = 4;
/// Runs of a set-up that are tried by hand at most.
const MOST_HAND_RUNS: usize = 9;

fn allowance() -> Allowance {
    let memory_bytes = process::total_memory().unwrap_or(4 << 30) / 5 * 4;
    Allowance { threads: 1, memory_bytes, local_files: false }
}

fn parsed(spec: &Value) -> Result<JobBody, String> {
    body::parse(spec, allowance(), &NoSources).map_err(|error| {
        let violations = error.violations();
        violations.iter().map(|v| format!("{}: {}", v.pointer, v.detail)).collect::<Vec<_>>().join("; ")
    })
}

/// The outcomes of a case, and a line for every trial.
pub(super) fn outcomes(
    workspace: &Workspace,
    name: &str,
    case: &StudyCase,
    full: bool,
    show: &mut dyn FnMut(&Outcome) -> std::io::Result<()>,
) -> std::io::Result<(Vec<Outcome>, Vec<String>)> {
    let (mut all, mut lines) = (Vec::new(), Vec::new());
    for part in &case.parts {
        let found = match part {
            Part::Trials(trials) if trials.is_long && !full => continue,
            Part::Trials(trials) => of_trials(workspace, trials, &mut lines),
            Part::Order { title, base, sweep, order } => vec![of_order(workspace, title, (base, sweep), *order)],
            Part::Series { title, spacings, values, convergence } => {
                vec![of_series(title, (spacings, values), convergence)]
            }
        };
        for outcome in found {
            let outcome = Outcome { case: name.to_owned(), ..outcome };
            show(&outcome)?;
            all.push(outcome);
        }
    }
    Ok((all, lines))
}

fn outcome(title: &str, bound: Bound, value: Result<f64, String>, cpu_s: f64) -> Outcome {
    let (value, failure) = match value {
        Ok(value) => (value, None),
        Err(cause) => (f64::NAN, Some(cause)),
    };
    Outcome {
        case: String::new(),
        title: title.to_owned(),
        paper: None,
        bound,
        value,
        cpu_s,
        is_met: bound.is_met(value),
        failure,
    }
}

/// Whether a series is recognized: 1 or 0.
fn of_series(title: &str, (spacings, values): (&[f64], &[f64]), convergence: &str) -> Outcome {
    let levels: Vec<Level> =
        spacings.iter().zip(values).map(|(h, value)| Level { spacing: *h, value: *value, cpu_s: 1.0 }).collect();
    let target = Target { subject: Subject::Value, theory: None, tolerance: 1e-9, is_relative: false, scale: 1.0 };
    let found = assess(&levels, &target).convergence.map(crate::convergence::Convergence::word);
    let value = f64::from(u8::from(found == Some(convergence)));
    outcome(&format!("{title}: recognized as {convergence}"), Bound::AtLeast(1.0), Ok(value), 0.0)
}

/// A run of a study in this process.
struct Runner<'a> {
    workspace: &'a Workspace,
    plan: &'a Plan,
    base: &'a Value,
    /// CPU seconds of all runs so far.
    spent_s: f64,
}

/// What a study has come to.
struct Refined {
    /// Number of the set-up that went on.
    setup: usize,
    /// Its levels.
    levels: Vec<MeasuredLevel>,
    /// The spacing that is told, by that of the first level.
    share: Option<f64>,
}

impl Runner<'_> {
    /// A level, run now or kept from before.
    fn level(&mut self, setup: &SweepPoint, share: f64) -> Result<MeasuredLevel, Ended> {
        let lacking = |message: String| Ended { reason: None, message };
        let point = self.plan.spec.point_at(self.base, setup, share);
        let body = point_body(self.base, &point, allowance(), &NoSources).map_err(|error| {
            lacking(error.violations().first().map_or_else(String::new, |v| format!("{}: {}", v.pointer, v.detail)))
        })?;
        let directory = self.workspace.run(&body.spec, Keep::Report)?;
        let relative = self.plan.spec.until.relative;
        let (mut level, _) =
            measured_level::read(&directory, body.scene.as_ref(), &self.plan.quantity, relative).map_err(lacking)?;
        if level.cpu_s < SHORT_S {
            for _ in 0..AGAIN {
                level.cpu_s = level.cpu_s.min(self.workspace.time_again(&body.spec)?);
            }
        }
        self.spent_s += level.cpu_s;
        Ok(level)
    }

    /// Levels until the study ends, or until a spacing is told where it serves a job.
    fn refine(&mut self, curves: Option<&Curves>, serves: bool) -> Result<Refined, String> {
        let mut setups = vec![Setup::default(); self.plan.setups.len()];
        let mut chosen = (setups.len() == 1).then_some(0);
        loop {
            let step = next_step(&self.plan.spec, &self.plan.quantity, &setups, chosen);
            let is_last = matches!(step, Step::End { .. });
            let by_levels = |number: usize| Some((number, tell(self.plan, &setups[number], is_last)?.share));
            let by_short_runs = |curves: &Curves| {
                let found = short_runs::tell(self.plan, &setups, curves)?;
                Some((found.setup, found.told.share))
            };
            let told = chosen.and_then(by_levels).or_else(|| curves.and_then(by_short_runs)).filter(|_| serves);
            if let Some((setup, share)) = told {
                return Ok(Refined { setup, levels: setups[setup].levels.clone(), share: Some(share) });
            }
            match step {
                Step::Make { setup, level } => {
                    let share = self.plan.spec.ratio.powf(-(level as f64));
                    let measured = self.level(&self.plan.setups[setup], share);
                    match measured {
                        Ok(measured) => setups[setup].levels.push(measured),
                        Err(Ended { reason, message }) if serves => {
                            setups[setup].pass_or_stop(&self.plan.spec, reason, message);
                        }
                        Err(Ended { message, .. }) => {
                            setups[setup].obstacle = Some((RefinementOutcome::Failed, message));
                        }
                    }
                }
                Step::Choose { setup } => chosen = Some(setup),
                Step::End { message, .. } if serves => return Err(message),
                Step::End { .. } => {
                    let setup = chosen.unwrap_or(0);
                    return Ok(Refined { setup, levels: setups[setup].levels.clone(), share: None });
                }
            }
        }
    }
}

fn of_order(workspace: &Workspace, title: &str, (base, sweep): (&Value, &Value), order: f64) -> Outcome {
    let bound = Bound::Within { value: order, tolerance: ORDER_TOLERANCE };
    let Some(plan) = Plan::new(sweep, base) else {
        return outcome(title, bound, Err("the sweep is not understood".to_owned()), 0.0);
    };
    let mut runner = Runner { workspace, plan: &plan, base, spent_s: 0.0 };
    let found = runner.refine(None, false).and_then(|refined| {
        let judged = judge(&plan.spec, &plan.quantity, &refined.levels);
        judged.order.map(|order| order.value).ok_or_else(|| "the levels tell no order".to_owned())
    });
    outcome(&format!("{title}: observed order"), bound, found, runner.spent_s)
}

/// What came of one trial.
struct Tried {
    is_met: bool,
    reached: f64,
    /// CPU seconds of the run.
    run_s: f64,
    /// CPU seconds, the study included.
    cpu_s: f64,
    /// Those of the best set-up found by hand.
    best_s: f64,
    spacing: f64,
}

fn of_trials(workspace: &Workspace, trials: &Trials, lines: &mut Vec<String>) -> Vec<Outcome> {
    let (mut met, mut worst, mut worst_whole, mut cpu_s) = (0_usize, 0.0_f64, 0.0_f64, 0.0);
    for trial in &trials.trials {
        match try_one(workspace, trials, trial) {
            Ok(tried) => {
                let Tried { is_met, reached, run_s, cpu_s: spent, best_s, spacing } = tried;
                met += usize::from(is_met);
                worst = worst.max(run_s / best_s);
                worst_whole = worst_whole.max(spent / best_s);
                cpu_s += spent;
                lines.push(format!(
                    "| {} | {} | {:.1e} | {reached:.2e} | {spacing:.3e} | {run_s:.3} | {spent:.3} | {best_s:.3} | {:.2} |",
                    trials.title,
                    trial.scene,
                    trial.tolerance,
                    run_s / best_s
                ));
            }
            Err(cause) => {
                lines.push(format!(
                    "| {} | {} | {:.1e} | {cause} | | | | |",
                    trials.title, trial.scene, trial.tolerance
                ));
            }
        }
    }
    let count = trials.trials.len().max(1);
    let share = outcome(
        &format!("{}: share of {count} trials that are met", trials.title),
        Bound::AtLeast(LEAST_SHARE),
        Ok(met as f64 / count as f64),
        cpu_s,
    );
    let whole = format!("{}: largest cost by that of the best set-up by hand, the study included", trials.title);
    let run = format!("{}: the same of the run alone", trials.title);
    vec![
        share,
        outcome(&whole, Bound::AtMost(MOST_COST), Ok(worst_whole), cpu_s),
        outcome(&run, Bound::AtMost(MOST_COST), Ok(worst), cpu_s),
    ]
}

fn try_one(workspace: &Workspace, trials: &Trials, trial: &Trial) -> Result<Tried, String> {
    let accuracy = json!({"quantity": trials.quantity, "tolerance": trial.tolerance, "relative": trials.relative});
    let body = parsed(&json!({"scene": trial.scene, "accuracy": accuracy}))?;
    let wanted = body.wanted.as_ref().ok_or("the trial asks for no accuracy")?;
    let known = |name: &str, quantity: &str, norm: &str| Ok(workspace.precision(name, quantity, norm));
    let sweep =
        for_accuracy::sweep(&body, wanted, allowance(), &NoSources, &known).map_err(|_| "no sweep was found")?;
    let base = for_accuracy::base_of(&body.spec);
    let plan = Plan::new(&sweep, &base).ok_or("the sweep is not understood")?;
    let mut runner = Runner { workspace, plan: &plan, base: &base, spent_s: 0.0 };
    let curves = Curves::of_plan(&plan, &base, allowance(), &NoSources, &known).map_err(|_| "no set-up is valid")?;
    let Refined { setup, mut levels, share } = runner.refine(curves.as_ref(), true)?;
    let share = share.ok_or("no spacing was told")?;
    let last = runner.level(&plan.setups[setup], share)?;
    let spent = runner.spent_s;
    levels.retain(|level| level.spacing > 1.001 * last.spacing);
    levels.push(last.clone());
    let judged = judge(&plan.spec, &plan.quantity, &levels);
    let reached = judged.uncertainty.unwrap_or(f64::NAN);
    let reference = judged.extrapolated.filter(|_| !plan.quantity.is_error());
    let best = by_hand(&mut runner, trials, (share, reference))?;
    Ok(Tried { is_met: judged.is_met, reached, run_s: last.cpu_s, cpu_s: spent, best_s: best, spacing: last.spacing })
}

/// CPU seconds of the cheapest run that meets the tolerance, over set-ups and spacings a tenth apart. Values without an exact answer are
/// compared with the extrapolated one.
fn by_hand(runner: &mut Runner, trials: &Trials, (share, reference): (f64, Option<f64>)) -> Result<f64, String> {
    let mut best = f64::INFINITY;
    for setup in &trials.by_hand {
        let values: Vec<(String, Value)> =
            setup.iter().map(|(pointer, value)| (pointer.clone(), value.clone())).collect();
        let places = vec![String::new(); values.len()];
        let setup = SweepPoint { values, places };
        let (mut share, mut was_met) = (share, None);
        for _ in 0..MOST_HAND_RUNS {
            let Ok(level) = runner.level(&setup, share) else { break };
            let relative = runner.plan.spec.until.relative;
            let error = match reference {
                Some(right) => (level.value - right).abs() / if relative { right.abs() } else { 1.0 },
                None => level.value / if relative { level.scale } else { 1.0 },
            };
            let is_met = error <= runner.plan.spec.until.tolerance;
            if error > HOPELESS * runner.plan.spec.until.tolerance {
                break;
            }
            if is_met {
                best = best.min(level.cpu_s);
            }
            // Coarser as long as it is met, finer as long as it is not: the turn is the best spacing.
            if was_met.is_some_and(|was_met| was_met != is_met) {
                break;
            }
            was_met = Some(is_met);
            share *= if is_met { HAND_RATIO } else { HAND_RATIO.recip() };
        }
    }
    if best.is_finite() { Ok(best) } else { Err("no set-up by hand meets the tolerance".to_owned()) }
}
