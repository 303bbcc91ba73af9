//! Jobs that ask for an accuracy: the small study that finds their spacing.

use crate::refinement::decision::Setup;
use crate::refinement::spacing::{chosen, tell};
use crate::refinement::{Plan, for_accuracy};
use crate::service::store::{NewJob, NewStudy, Store, StoreError};
use crate::spec::accuracy::{KnownLevel, Wanted};
use crate::spec::body::{Allowance, BodyError, JobBody, JobSpec};
use crate::spec::quantity::Quantity;
use crate::spec::study::{self, MeasuredLevel, point_body};
use crate::spec::work_precision::{cost_at, problem_of};
use meniscus::spec::{Given, Violation};
use serde_json::json;

/// Bytes of the name of such a study at most.
const LONGEST_NAME: usize = 100;

/// The study that finds the spacing for a body that asks for an accuracy.
///
/// # Errors
/// Everything that is wrong with its levels, at the places of the job's body, or a failing store.
pub fn study_for(
    store: &Store,
    body: &JobBody,
    wanted: &Wanted,
    allowance: Allowance,
) -> Result<NewStudy, BodyError<StoreError>> {
    let sweep = for_accuracy::sweep(body, wanted, allowance, store, &|name, quantity, norm| {
        store.precision(name, quantity, norm)
    })?;
    let spec = json!({"base": for_accuracy::base_of(&body.spec), "sweep": sweep});
    let calibration = store.calibration().map_err(BodyError::Lookup)?;
    let parsed = study::parse(&spec, allowance, 1, store, &calibration, NewJob::from_body);
    let parsed = parsed.map_err(|error| match error {
        BodyError::Invalid(violations) => BodyError::Invalid(violations.into_iter().map(at_job).collect()),
        error => error,
    })?;
    let name = format!("spacing for {}", body.resolved.name.as_deref().unwrap_or("an accuracy"));
    let name = Some(name.chars().take(LONGEST_NAME).collect());
    Ok(NewStudy { name, labels: body.resolved.labels.clone(), ..parsed.into() })
}

/// The body with a spacing that earlier runs of the same problem tell, where there are enough of them; the cheapest of the set-ups
/// that the body leaves open.
///
/// # Errors
/// A failing store.
pub fn known_body(
    store: &Store,
    body: &JobBody,
    wanted: &Wanted,
    allowance: Allowance,
) -> Result<Option<JobBody>, BodyError<StoreError>> {
    let base = for_accuracy::base_of(&body.spec);
    let sweep = for_accuracy::sweep(body, wanted, allowance, store, &|name, quantity, norm| {
        store.precision(name, quantity, norm)
    })?;
    let Some(plan) = Plan::new(&sweep, &base) else { return Ok(None) };
    let Quantity::Error { quantity, norm, time: None } = &plan.quantity else { return Ok(None) };
    if plan.spec.until.relative {
        return Ok(None);
    }
    let mut best: Option<(f64, JobBody)> = None;
    for point in &plan.setups {
        let body_at = |share: f64| point_body(&base, &plan.spec.point_at(&base, point, share), allowance, store);
        let first = match body_at(1.0) {
            Ok(first) => first,
            Err(BodyError::Invalid(_)) => continue,
            Err(error) => return Err(error),
        };
        let sent = first.spec.as_object().map(|spec| Given::new(spec).raw(JobSpec::scene())).unwrap_or_default();
        let Some((problem, spacing)) = problem_of(&sent).zip(first.scene.spacing()) else { continue };
        let known = store.precision(&problem, quantity, norm).map_err(BodyError::Lookup)?;
        let theory = first.scene.order(quantity, norm);
        let levels: Vec<MeasuredLevel> = known.iter().map(|level| MeasuredLevel::of_error(*level, theory)).collect();
        let setup = Setup { levels, ..Setup::default() };
        let told = if setup.levels.len() < LEAST_KNOWN { None } else { tell(&plan, &setup, false) };
        let (Some(told), Some(coarsest)) = (told, setup.levels.first()) else { continue };
        let share = told.share * coarsest.spacing / spacing;
        let Some(cost) = cost_at(&known, told.share * coarsest.spacing) else { continue };
        if best.as_ref().is_none_or(|(least, _)| cost < *least)
            && let Ok(mut found) = body_at(share)
        {
            let basis = format!("{} earlier runs with this build", setup.levels.len());
            let levels = setup.levels.iter().map(KnownLevel::from).collect();
            found.resolved.accuracy = Some(chosen(&plan, levels, told, basis));
            found.spec = body.spec.clone();
            found.predecessors.clone_from(&body.predecessors);
            best = Some((cost, found));
        }
    }
    Ok(best.map(|(_, body)| body))
}

/// Runs of a problem that tell a spacing, at least.
const LEAST_KNOWN: usize = 3;

/// The violation of a level at the place of the job's body.
fn at_job(violation: Violation) -> Violation {
    let rest = violation.pointer.strip_prefix("/base").map(str::to_owned);
    Violation { pointer: rest.unwrap_or_else(|| "/accuracy".to_owned()), ..violation }
}
