//! Jobs that ask for an accuracy: the small study that finds their spacing.

use crate::refinement::for_accuracy;
use crate::service::store::{NewJob, NewStudy, Store, StoreError};
use crate::spec::accuracy::Wanted;
use crate::spec::body::{Allowance, BodyError, JobBody};
use crate::spec::study;
use meniscus::spec::Violation;
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
    let sweep = for_accuracy::sweep(body, wanted, allowance, store)?;
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

/// The violation of a level at the place of the job's body.
fn at_job(violation: Violation) -> Violation {
    let rest = violation.pointer.strip_prefix("/base").map(str::to_owned);
    Violation { pointer: rest.unwrap_or_else(|| "/accuracy".to_owned()), ..violation }
}
