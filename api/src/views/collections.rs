//! Views of studies, uploads and estimates.

use super::FindingView;
use crate::base_path::address;
use meniscus::spec::Word;
use meniscus_jobs::service::store::{RefinementRow, StudyRow, UploadRow};
use meniscus_jobs::spec::body::JobBody;
use meniscus_jobs::spec::states::State;
use meniscus_jobs::spec::study::{RefinementOutcome, RefinementState, StudyForecast};
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// A study: one body and a sweep of its values, run as one job for each point.
#[derive(Debug, Serialize, ToSchema)]
pub struct StudyView {
    /// `std_` and a ULID.
    pub id: String,
    /// Name that the client gave.
    pub name: Option<String>,
    /// Labels that the client gave.
    pub labels: BTreeMap<String, String>,
    /// `queued`, `running`, `paused`, `succeeded`, `failed` or `canceled`: follows from the states of its points.
    pub state: &'static str,
    /// Points by the state of their latest job; `deleted` where the job was deleted.
    pub counts: BTreeMap<String, u64>,
    /// Number of points; of a study that refines, of the levels made so far.
    pub points: u64,
    /// Share of the points that have ended; of a study that refines, of the levels that it may make.
    pub fraction: f64,
    /// The body that all points share.
    pub base: Value,
    /// The sweep as sent.
    pub sweep: Value,
    /// JSON pointers of the values that vary.
    pub axes: Vec<String>,
    /// Most jobs of the study that run at the same time; null for no limit.
    pub max_parallel: Option<u64>,
    /// What happens if a point fails: `continue` or `stop`.
    pub on_failure: String,
    /// Estimate of all points together; of a study that refines, of the levels that are made in any case.
    pub estimate: Value,
    /// Why a study that refines makes no further level: `tolerance`, `levels`, `budget`, `memory`, `divergent`, `failed` or
    /// `canceled`; null while it goes on, and of other studies.
    pub outcome: Option<&'static str>,
    /// The same in a sentence.
    pub message: Option<String>,
    /// Name of the token that made it; null without tokens.
    pub owner: Option<String>,
    /// Time of creation (RFC 3339, UTC).
    pub created_at: String,
    /// Addresses of related resources.
    pub links: BTreeMap<&'static str, String>,
}

list! {
    /// A page of studies.
    StudyList of StudyView, next: "Cursor of the next page."
}

/// Points and estimate of a study that was not created.
#[derive(Debug, Serialize, ToSchema)]
pub struct DryRunView {
    /// The values of every point, by pointer.
    pub points: Vec<Value>,
    /// Estimate of all points together.
    pub estimate: Value,
}

/// A file that a client uploaded.
#[derive(Debug, Serialize, ToSchema)]
pub struct UploadView {
    /// `upl_` and a ULID.
    pub id: String,
    /// What the file is used as: `checkpoint`, `points`, `surface`, `queries` or `mesh`.
    pub r#as: &'static str,
    /// `quarantined`, `ready` or `rejected`.
    pub state: String,
    /// Why the file was rejected.
    pub reason: Option<String>,
    /// What was found in the file.
    pub found: Value,
    /// Name that the client gave.
    pub name: Option<String>,
    /// Size in bytes.
    pub size_bytes: u64,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
    /// Name of the token that made it; null without tokens.
    pub owner: Option<String>,
    /// Time of creation (RFC 3339, UTC).
    pub created_at: String,
    /// Time at which the examination ended (RFC 3339, UTC).
    pub checked_at: Option<String>,
    /// Addresses of related resources.
    pub links: BTreeMap<&'static str, String>,
}

list! {
    /// A page of uploads.
    UploadList of UploadView, next: "Cursor of the next page."
}

/// What a job would need.
#[derive(Debug, Serialize, ToSchema)]
pub struct EstimateView {
    /// The body with every default filled in; null where a study is to find its spacing first.
    pub resolved: Value,
    /// What the study takes that finds the spacing for an accuracy; null where none is needed.
    pub study: Option<Value>,
    /// Number of particles.
    pub particles: u64,
    /// Time step, in units of the scene.
    pub time_step: f64,
    /// Number of steps.
    pub steps: u64,
    /// Resident memory of the worker in bytes.
    pub memory_bytes: u64,
    /// Size of all files in bytes.
    pub disk_bytes: u64,
    /// CPU time in seconds; null if the speed of this machine is unknown.
    pub cpu_s: Option<f64>,
    /// Wall-clock time in seconds, without waiting in the queue; null if the speed of this machine is unknown.
    pub wall_s: Option<f64>,
    /// Measurements on which the times rest.
    pub basis: String,
    /// Dimensionless numbers of the scene by their names, such as `Re` and `La`; empty where its kind has none.
    pub numbers: BTreeMap<&'static str, f64>,
    /// What is doubtful about the scene before it runs.
    pub warnings: Vec<FindingView>,
}

impl From<JobBody> for EstimateView {
    fn from(body: JobBody) -> Self {
        let basis = body.forecast.basis().to_owned();
        let estimate = body.forecast.estimate;
        let time = body.forecast.time.as_ref();
        Self {
            resolved: body.resolved.to_json(),
            study: None,
            particles: estimate.particles,
            time_step: estimate.time_step,
            steps: estimate.steps,
            memory_bytes: body.forecast.memory_bytes,
            disk_bytes: body.forecast.disk_bytes,
            cpu_s: time.map(|time| time.cpu_s),
            wall_s: time.map(|time| time.wall_s),
            basis,
            numbers: body.scene.numbers().into_iter().collect(),
            warnings: body.scene.warnings().into_iter().map(FindingView::from).collect(),
        }
    }
}

impl EstimateView {
    /// The estimate of a body that asks for an accuracy: the study that finds its spacing comes first, and tells what the run takes.
    #[must_use]
    pub fn of_accuracy(body: &JobBody, study: &StudyForecast) -> Self {
        let basis = format!(
            "the spacing is not known before a study has run; its first {} levels are estimated, and it goes on until the spacing can \
             be told",
            study.points
        );
        let numbers = body.scene.numbers().into_iter().collect();
        Self {
            resolved: Value::Null,
            study: Some(serde_json::json!(study)),
            particles: 0,
            time_step: 0.0,
            steps: 0,
            memory_bytes: study.memory_bytes,
            disk_bytes: study.disk_bytes,
            cpu_s: None,
            wall_s: None,
            basis,
            numbers,
            warnings: Vec::new(),
        }
    }
}

/// State of a study from the states of its points.
fn state_of(counts: &BTreeMap<State, u64>) -> &'static str {
    let has = |wanted: &[State]| counts.iter().any(|(state, count)| *count > 0 && wanted.contains(state));
    if has(&[State::Running, State::Pausing, State::Canceling, State::Interrupted]) {
        "running"
    } else if has(&[State::Queued]) {
        // A study also runs between two of its jobs.
        if has(&[State::Succeeded, State::Failed]) { "running" } else { "queued" }
    } else if has(&[State::Paused]) {
        "paused"
    } else if has(&[State::Failed]) {
        "failed"
    } else if has(&[State::Canceled]) {
        "canceled"
    } else {
        "succeeded"
    }
}

/// State of a study that refines: between two levels it runs, and in the end it is what its outcome says.
fn state_of_refinement(row: &StudyRow, refinement: &RefinementRow) -> &'static str {
    let has_unfinished = row.counts.iter().any(|(state, count)| *count > 0 && !state.is_terminal());
    match (refinement.state, refinement.outcome) {
        (RefinementState::Ended, _) if has_unfinished => "running",
        (RefinementState::Ended, Some(RefinementOutcome::Failed)) => "failed",
        (RefinementState::Ended, Some(RefinementOutcome::Canceled)) => "canceled",
        (RefinementState::Ended, _) => "succeeded",
        (RefinementState::Paused, _) if !has_unfinished => "paused",
        (RefinementState::Open, _) if !has_unfinished => {
            if refinement.levels == 0 {
                "queued"
            } else {
                "running"
            }
        }
        _ => state_of(&row.counts),
    }
}

/// Share of a study that is done; once no further point is made it is 1.
fn fraction_of(row: &StudyRow, ended: u64) -> f64 {
    match &row.refinement {
        Some(refinement) if refinement.state == RefinementState::Ended => 1.0,
        Some(refinement) => ended as f64 / refinement.most_levels.max(1) as f64,
        None => ended as f64 / row.points.max(1) as f64,
    }
}

impl From<StudyRow> for StudyView {
    fn from(row: StudyRow) -> Self {
        let there: u64 = row.counts.values().sum();
        let ended: u64 = row.counts.iter().filter(|(state, _)| state.is_terminal()).map(|(_, count)| count).sum();
        let state =
            row.refinement.as_ref().map_or_else(|| state_of(&row.counts), |found| state_of_refinement(&row, found));
        let deleted = if row.refinement.is_some() { 0 } else { row.points.saturating_sub(there) };
        let mut counts: BTreeMap<String, u64> =
            row.counts.iter().map(|(state, count)| (state.word().to_owned(), *count)).collect();
        if deleted > 0 {
            counts.insert("deleted".to_owned(), deleted);
        }
        let parts = ["jobs", "events", "table", "report", "cancel", "pause", "resume", "retry"];
        let links = super::links(address(&format!("/v1/studies/{}", row.id)), &parts);
        Self {
            state,
            fraction: fraction_of(&row, ended + deleted),
            outcome: row.refinement.as_ref().and_then(|found| found.outcome).map(RefinementOutcome::word),
            message: row.refinement.as_ref().and_then(|found| found.message.clone()),
            counts,
            id: row.id,
            name: row.name,
            labels: row.labels,
            points: row.points,
            base: row.base,
            sweep: row.sweep,
            axes: row.axes,
            max_parallel: row.max_parallel,
            on_failure: row.on_failure,
            estimate: serde_json::json!(row.forecast),
            owner: row.owner,
            created_at: row.created_at,
            links,
        }
    }
}

impl From<UploadRow> for UploadView {
    fn from(row: UploadRow) -> Self {
        let links = BTreeMap::from([("self", address(&format!("/v1/uploads/{}", row.id)))]);
        Self {
            id: row.id,
            r#as: row.purpose.word(),
            state: row.state,
            reason: row.reason,
            found: serde_json::json!(row.found),
            name: row.name,
            size_bytes: row.size_bytes,
            sha256: row.sha256,
            owner: row.owner,
            created_at: row.created_at,
            checked_at: row.checked_at,
            links,
        }
    }
}
