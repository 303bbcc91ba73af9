//! Studies that refine: in every round of the supervisor each of them takes its next step.
//!
//! A step follows from the study's spec and from what the store keeps of its levels ([`crate::refinement::decision`]). It is made in one transaction,
//! so that a service that is killed at any moment goes on where it was.

mod measuring;
pub mod report;
mod serving;

use crate::refinement::Plan;
use crate::refinement::decision::{Setup, Step, level_cost, next_step};
use crate::service::store::{
    Change, LevelRow, LevelSource, NewJob, NewLevel, Store, StoreError, StudyRow, scene_sha256,
};
use crate::spec::body::{BodyError, JobBody};
use crate::spec::states::{Reason, State, Trigger};
use crate::spec::study::{RefinementOutcome, point_body};
use meniscus::spec::Violation;

/// Lets every study that refines, and of which nothing is running, take its next step. Studies that cannot are logged, so that they
/// do not hold up others; the number of those is the answer.
///
/// # Errors
/// When the store fails to list them.
pub fn advance_all(store: &Store) -> Result<usize, StoreError> {
    let mut failed = 0;
    for id in store.refinements_of_ended_jobs()? {
        store.change_study(&id, Trigger::Cancel, &Change::because(Reason::DependencyFailed))?;
    }
    for id in store.refinements_to_advance()? {
        if let Err(error) = advance(store, &id) {
            tracing::error!(study = id, %error, "a study could not take its next step");
            failed += 1;
        }
    }
    Ok(failed)
}

/// The plan of a study; None where it does not refine, or where this version of the program does not understand it.
fn plan_of(study: &StudyRow) -> Option<Plan> {
    study.refinement.as_ref()?;
    Plan::new(&study.sweep, &study.base)
}

/// The levels by set-up; `serves` says whether the study finds the spacing for a job.
fn by_setup(plan: &Plan, levels: &[LevelRow], serves: bool) -> Vec<Setup> {
    let mut setups = vec![Setup::default(); plan.setups.len()];
    for row in levels {
        let Some(setup) = setups.get_mut(row.setup as usize) else { continue };
        match (&row.measured, row.state) {
            (Some(measured), _) => setup.levels.push(measured.clone()),
            // Where a study chooses its levels itself, the first ones may be too coarse for the scene.
            (None, Some(State::Failed)) if serves && !row.is_to_repeat => {
                setup.pass_or_stop(&plan.spec, row.reason, obstacle(row).1);
            }
            (None, Some(State::Failed | State::Canceled)) if !row.is_to_repeat => setup.obstacle = Some(obstacle(row)),
            (None, None) => {
                let message = format!("the job of level {} was deleted before it was read", row.level);
                setup.obstacle = Some((RefinementOutcome::Failed, message));
            }
            (None, _) => {}
        }
    }
    setups
}

/// Why a set-up cannot go on behind a level that has not succeeded.
fn obstacle(row: &LevelRow) -> (RefinementOutcome, String) {
    let (outcome, past) = match row.state {
        Some(State::Canceled) => (RefinementOutcome::Canceled, "was canceled"),
        _ => (RefinementOutcome::Failed, "has failed"),
    };
    let cause = row.message.as_ref().map(|message| format!(": {message}")).unwrap_or_default();
    (outcome, format!("level {} {past}{cause}", row.level))
}

fn advance(store: &Store, id: &str) -> Result<(), StoreError> {
    let Some(study) = store.study(id)? else { return Ok(()) };
    let Some(refinement) = &study.refinement else { return Ok(()) };
    let Some(plan) = plan_of(&study) else {
        let message = "this version of the program does not understand the sweep of the study";
        return end(store, &study, RefinementOutcome::Failed, message);
    };
    let serves = refinement.job.is_some();
    let mut levels = store.levels(id)?;
    if let Some(level) = levels.iter().find(|level| level.is_to_repeat) {
        return match make(store, &study, &plan, &Place::of(level), &by_setup(&plan, &levels, serves))? {
            None => Ok(()),
            Some((outcome, message)) => end(store, &study, outcome, &message),
        };
    }
    if let Some(message) = take_results(store, &study, &plan, &mut levels)? {
        return end(store, &study, RefinementOutcome::Failed, &message);
    }
    let mut setups = by_setup(&plan, &levels, serves);
    // A set-up whose next level does not fit is put aside; there are as many turns as set-ups.
    for _ in 0..=setups.len() {
        let chosen = refinement.chosen.map(|chosen| chosen as usize);
        let step = next_step(&plan.spec, &plan.quantity, &setups, chosen);
        if let Some(job) = &refinement.job
            && serving::serve(store, &study, &plan, &setups, (job, &step))?.is_some()
        {
            return Ok(());
        }
        let obstacle = match step {
            Step::End { outcome, message } => return end(store, &study, outcome, &message),
            Step::Choose { setup } => return store.choose_setup(id, setup as u64),
            Step::Make { setup, level } => {
                let place = Place { number: levels.len() as u64, setup, level: level as u64, repeats: None };
                (setup, make(store, &study, &plan, &place, &setups)?)
            }
        };
        match obstacle {
            (_, None) => return Ok(()),
            (_, Some((RefinementOutcome::Budget, message))) => {
                return end(store, &study, RefinementOutcome::Budget, &message);
            }
            (setup, obstacle) => setups[setup].obstacle = obstacle,
        }
    }
    Ok(())
}

/// Ends a study, and the job that waits for it.
fn end(store: &Store, study: &StudyRow, outcome: RefinementOutcome, message: &str) -> Result<(), StoreError> {
    match study.refinement.as_ref().and_then(|refinement| refinement.job.as_ref()) {
        Some(job) => store.fail_waiting_job(&study.id, job, outcome, message),
        None => store.end_refinement(&study.id, outcome, message),
    }
}

/// Keeps what levels have come to that succeeded since the last round. Returns what a report lacks, if it lacks something.
fn take_results(
    store: &Store,
    study: &StudyRow,
    plan: &Plan,
    levels: &mut [LevelRow],
) -> Result<Option<String>, StoreError> {
    for level in levels.iter_mut().filter(|level| level.measured.is_none() && level.state == Some(State::Succeeded)) {
        let Some(job) = level.job.as_ref().map(|id| store.job(id)).transpose()?.flatten() else { continue };
        match measuring::measure(store, &job, &plan.quantity, plan.spec.until.relative) {
            Ok((measured, _)) => {
                store.keep_measured(&study.id, level.number, &measured)?;
                level.measured = Some(measured);
            }
            Err(cause) => return Ok(Some(format!("level {} says nothing of the quantity: {cause}", level.level))),
        }
    }
    Ok(None)
}

/// Where a level belongs.
struct Place {
    number: u64,
    setup: usize,
    level: u64,
    /// The job that it repeats.
    repeats: Option<String>,
}

impl Place {
    fn of(row: &LevelRow) -> Self {
        let repeats = row.job.clone().filter(|_| row.state.is_some());
        Self { number: row.number, setup: row.setup as usize, level: row.level, repeats }
    }
}

/// Makes a level, or says why it is not made.
fn make(
    store: &Store,
    study: &StudyRow,
    plan: &Plan,
    place: &Place,
    setups: &[Setup],
) -> Result<Option<(RefinementOutcome, String)>, StoreError> {
    let (Some(refinement), Some(setup)) = (&study.refinement, plan.setups.get(place.setup)) else { return Ok(None) };
    let point = plan.spec.point(&study.base, setup, place.level);
    let mut body = match point_body(&study.base, &point, refinement.allowance(), store) {
        Ok(body) => body,
        Err(BodyError::Invalid(violations)) => return Ok(Some(refused(place.level, &violations))),
        Err(BodyError::Lookup(error)) => return Err(error),
    };
    let sha256 = scene_sha256(&body.resolved.scene);
    let is_new = place.repeats.is_none();
    if plan.spec.reuse && is_new {
        let found = measuring::earlier(store, &body.resolved, &sha256, &plan.quantity, plan.spec.until.relative)?;
        if let Some((job, measured)) = found {
            let source = LevelSource::Earlier { job, measured };
            store.make_level(&study.id, study.owner.as_ref(), new_level(place, source))?;
            return Ok(None);
        }
    }
    body.forecast.time_by(&store.calibration()?);
    if let Some(message) = over_budget(store, study, plan, &body, setups.get(place.setup))? {
        return Ok(Some((RefinementOutcome::Budget, message)));
    }
    let mut job = NewJob::from_body(&body);
    job.retry_of.clone_from(&place.repeats);
    store.make_level(&study.id, study.owner.as_ref(), new_level(place, LevelSource::Job(Box::new(job))))?;
    Ok(None)
}

fn new_level(place: &Place, source: LevelSource) -> NewLevel {
    NewLevel { number: place.number, setup: place.setup as u64, level: place.level, source }
}

/// Why a body that was valid when the study was made is refused now: most often it does not fit into the memory.
fn refused(level: u64, violations: &[Violation]) -> (RefinementOutcome, String) {
    let outcome = if violations.iter().all(|violation| violation.code == "memory") {
        RefinementOutcome::Memory
    } else {
        RefinementOutcome::Failed
    };
    let causes: Vec<String> =
        violations.iter().map(|violation| format!("{}: {}", violation.pointer, violation.detail)).collect();
    (outcome, format!("level {level} cannot be made: {}", causes.join("; ")))
}

/// Why a level is beyond the budget, if it is.
fn over_budget(
    store: &Store,
    study: &StudyRow,
    plan: &Plan,
    body: &JobBody,
    setup: Option<&Setup>,
) -> Result<Option<String>, StoreError> {
    let Some(budget) = plan.spec.budget.as_ref().map(|budget| budget.cpu_s) else { return Ok(None) };
    let spacing = body.scene.spacing().unwrap_or(f64::NAN);
    let forecast = body.forecast.time.as_ref().map(|time| time.cpu_s);
    let levels = setup.map_or(&[][..], |setup| &setup.levels);
    let cost = level_cost(levels, spacing, forecast).unwrap_or(0.0);
    let spent = store.spent_cpu_s(&study.id)?;
    let message = format!(
        "the next level would take about {cost:.1} CPU seconds; {spent:.1} of the {budget} of the budget are spent"
    );
    Ok((spent + cost > budget).then_some(message))
}
