//! A study that serves a job: it goes on until the spacing can be told with which the job reaches its accuracy, and then gives the
//! job that spacing.

use crate::refinement::Plan;
use crate::refinement::decision::{Setup, Step};
use crate::refinement::for_accuracy::base_of;
use crate::refinement::spacing::{Told, chosen, tell};
use crate::service::store::{JobRow, NewJob, Store, StoreError, StudyRow};
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
    let told = number.and_then(|number| {
        let levels = &setups.get(number)?.levels;
        Some((number, tell(plan, levels, end.is_some())?))
    });
    match (told, end) {
        (Some((number, told)), _) => release(store, study, plan, (&row, &setups[number], number), told).map(Some),
        (None, Some((outcome, message))) => store.fail_waiting_job(&study.id, job, outcome, message).map(Some),
        (None, None) => Ok(None),
    }
}

/// Gives the job its spacing.
fn release(
    store: &Store,
    study: &StudyRow,
    plan: &Plan,
    (job, setup, number): (&JobRow, &Setup, usize),
    told: Told,
) -> Result<(), StoreError> {
    let Some(refinement) = &study.refinement else { return Ok(()) };
    let point = plan.spec.point_at(&base_of(&job.spec), &plan.setups[number], told.share);
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
    body.resolved.accuracy = Some(chosen(plan, &setup.levels, told, &study.id));
    body.forecast.time_by(&store.calibration()?);
    let spacing = body.scene.spacing().unwrap_or_default();
    let message =
        format!("the job runs with a spacing of {spacing:.4e}, its predicted error is {:.2e}", told.predicted);
    store.release_job(&study.id, &job.id, &NewJob::from_body(&body), &message)
}
