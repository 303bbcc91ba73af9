//! A study that serves a job: it goes on until the spacing can be told with which the job reaches its accuracy, and then gives the
//! job that spacing.

use crate::refinement::Plan;
use crate::refinement::decision::{Setup, Step};
use crate::refinement::for_accuracy::base_of;
use crate::refinement::short_runs::{self, Curves, Foretold};
use crate::refinement::spacing::{Told, chosen, tell};
use crate::service::store::{JobRow, NewJob, Store, StoreError, StudyRow};
use crate::spec::accuracy::{ChosenAccuracy, KnownLevel};
use crate::spec::body::{Allowance, BodyError};
use crate::spec::study::{RefinementOutcome, point_body};

/// Takes the next step of a study that serves a job; None where a further level or a choice is to be made as in every study.
pub(super) fn serve(
    store: &Store,
    study: &StudyRow,
    plan: &Plan,
    setups: &[Setup],
    (job, step): (&str, &Step),
) -> Result<Option<()>, StoreError> {
    let one = study.refinement.as_ref().and_then(|refinement| refinement.chosen);
    let number = if setups.len() == 1 { Some(0) } else { one.map(|one| one as usize) };
    let row = store.job(job)?.filter(|row| !row.state.is_terminal());
    let Some(row) = row else {
        return store
            .end_refinement(&study.id, RefinementOutcome::Canceled, "the job that it served has ended")
            .map(Some);
    };
    let end = match step {
        Step::End { outcome, message } => Some((*outcome, message.as_str())),
        _ => None,
    };
    let found = match number.and_then(|number| by_levels(study, plan, (number, setups.get(number)?), end.is_some())) {
        Some(found) => Some(found),
        None => by_short_runs(store, study, plan, (&row, setups))?,
    };
    match (found, end) {
        (Some(found), _) => release(store, study, plan, &row, found).map(Some),
        (None, Some((outcome, message))) => store.fail_waiting_job(&study.id, job, outcome, message).map(Some),
        (None, None) => Ok(None),
    }
}

/// The spacing of a job, and how it was found.
struct Found {
    setup: usize,
    told: Told,
    accuracy: ChosenAccuracy,
}

/// What the levels of a set-up tell.
fn by_levels(study: &StudyRow, plan: &Plan, (number, setup): (usize, &Setup), is_last: bool) -> Option<Found> {
    let told = tell(plan, setup, is_last)?;
    let basis = levels_of(study, setup.levels.len());
    let levels = setup.levels.iter().map(KnownLevel::from).collect();
    Some(Found { setup: number, told, accuracy: chosen(plan, levels, told, basis) })
}

fn levels_of(study: &StudyRow, count: usize) -> String {
    format!("{count} level{} of {}", if count == 1 { "" } else { "s" }, study.id)
}

/// What short runs of other scenes tell once a level of this one is known.
fn by_short_runs(
    store: &Store,
    study: &StudyRow,
    plan: &Plan,
    (job, setups): (&JobRow, &[Setup]),
) -> Result<Option<Found>, StoreError> {
    let Some(refinement) = &study.refinement else { return Ok(None) };
    let count = setups.iter().map(|setup| setup.levels.len()).sum();
    if count == 0 {
        return Ok(None);
    }
    let known = |name: &str, quantity: &str, norm: &str| store.precision(name, quantity, norm);
    match Curves::of_plan(plan, &base_of(&job.spec), refinement.allowance(), store, &known) {
        Ok(curves) => {
            let foretold = curves.and_then(|curves| short_runs::tell(plan, setups, &curves));
            Ok(foretold.map(|Foretold { setup, told, levels }| {
                let basis = format!("{}, and short runs of other scenes", levels_of(study, count));
                Found { setup, told, accuracy: chosen(plan, levels, told, basis) }
            }))
        }
        Err(BodyError::Lookup(error)) => Err(error),
        Err(BodyError::Invalid(_)) => Ok(None),
    }
}

/// Gives the job its spacing.
fn release(store: &Store, study: &StudyRow, plan: &Plan, job: &JobRow, found: Found) -> Result<(), StoreError> {
    let Found { setup, told, accuracy } = found;
    let Some(refinement) = &study.refinement else { return Ok(()) };
    let point = plan.spec.point_at(&base_of(&job.spec), &plan.setups[setup], told.share);
    let allowance: Allowance = refinement.allowance();
    let mut body = match point_body(&base_of(&job.spec), &point, allowance, store) {
        Ok(body) => body,
        Err(BodyError::Lookup(error)) => return Err(error),
        Err(BodyError::Invalid(violations)) => {
            let causes: Vec<String> = violations.iter().map(|violation| violation.detail.clone()).collect();
            let message = format!("the spacing that would reach it cannot be run: {}", causes.join("; "));
            return store.fail_waiting_job(&study.id, &job.id, RefinementOutcome::Memory, &message);
        }
    };
    if plan.setups.len() > 1 {
        store.choose_setup(&study.id, setup as u64)?;
    }
    body.resolved.accuracy = Some(accuracy);
    body.forecast.time_by(&store.calibration()?);
    let spacing = body.scene.spacing().unwrap_or_default();
    let message =
        format!("the job runs with a spacing of {spacing:.4e}, its predicted error is {:.2e}", told.predicted);
    store.release_job(&study.id, &job.id, &NewJob::from_body(&body), &message)
}
