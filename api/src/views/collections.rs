//! Studies, uploads and estimates as clients see them.

use meniscus_jobs::service::store::{StudyRow, UploadRow};
use meniscus_jobs::spec::body::JobBody;
use meniscus_jobs::spec::states::State;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// A study.
#[derive(Debug, Serialize, ToSchema)]
pub struct StudyView {
    /// `std_` and a ULID.
    pub id: String,
    /// Name.
    pub name: Option<String>,
    /// Labels.
    pub labels: BTreeMap<String, String>,
    /// `queued`, `running`, `paused`, `succeeded`, `failed` or `canceled`, from what its points are in.
    pub state: &'static str,
    /// Points by the state of their latest job; `deleted` where the job was deleted.
    pub counts: BTreeMap<String, u64>,
    /// Points.
    pub points: u64,
    /// Share of the points that have ended.
    pub fraction: f64,
    /// The body that all points share.
    pub base: Value,
    /// The sweep as sent.
    pub sweep: Value,
    /// Pointers that vary.
    pub axes: Vec<String>,
    /// Jobs at once.
    pub max_parallel: Option<u64>,
    /// `continue` or `stop`.
    pub on_failure: String,
    /// What all points were estimated to take.
    pub estimate: Value,
    /// RFC 3339, UTC.
    pub created_at: String,
    /// Where to go from here.
    pub links: BTreeMap<&'static str, String>,
}

list! {
    /// A page of studies.
    StudyList of StudyView, next: "Cursor of the next page."
}

/// What a study would be.
#[derive(Debug, Serialize, ToSchema)]
pub struct DryRunView {
    /// The values of every point, by pointer.
    pub points: Vec<Value>,
    /// What all points would take.
    pub estimate: Value,
}

/// An upload.
#[derive(Debug, Serialize, ToSchema)]
pub struct UploadView {
    /// `upl_` and a ULID.
    pub id: String,
    /// `checkpoint`, `points`, `surface` or `queries`.
    pub r#as: &'static str,
    /// `quarantined`, `ready` or `rejected`.
    pub state: String,
    /// Why it was rejected.
    pub reason: Option<String>,
    /// What was found in it.
    pub found: Value,
    /// Name.
    pub name: Option<String>,
    /// Bytes.
    pub size_bytes: u64,
    /// Digest.
    pub sha256: String,
    /// RFC 3339, UTC.
    pub created_at: String,
    /// When the check ended.
    pub checked_at: Option<String>,
    /// Where to go from here.
    pub links: BTreeMap<&'static str, String>,
}

list! {
    /// A page of uploads.
    UploadList of UploadView, next: "Cursor of the next page."
}

/// What a job would take.
#[derive(Debug, Serialize, ToSchema)]
pub struct EstimateView {
    /// The body with every default.
    pub resolved: Value,
    /// Particles.
    pub particles: u64,
    /// Time step.
    pub time_step: f64,
    /// Steps.
    pub steps: u64,
    /// Resident memory of the worker.
    pub memory_bytes: u64,
    /// Size of all files.
    pub disk_bytes: u64,
    /// CPU seconds; null while nothing is known of this machine.
    pub cpu_s: Option<f64>,
    /// Seconds by the clock, once it runs.
    pub wall_s: Option<f64>,
    /// What the times rest on.
    pub basis: String,
}

impl From<JobBody> for EstimateView {
    fn from(body: JobBody) -> Self {
        let json = body.forecast.to_json();
        let estimate = body.forecast.estimate;
        Self {
            resolved: body.resolved,
            particles: estimate.particles,
            time_step: estimate.time_step,
            steps: estimate.steps,
            memory_bytes: body.forecast.memory_bytes,
            disk_bytes: body.forecast.disk_bytes,
            cpu_s: json["cpu_s"].as_f64(),
            wall_s: json["wall_s"].as_f64(),
            basis: json["basis"].as_str().unwrap_or_default().to_owned(),
        }
    }
}

/// What a study is in, by its points.
fn state_of(counts: &BTreeMap<State, u64>) -> &'static str {
    let has = |wanted: &[State]| counts.iter().any(|(state, count)| *count > 0 && wanted.contains(state));
    if has(&[State::Running, State::Pausing, State::Canceling, State::Interrupted]) {
        "running"
    } else if has(&[State::Queued]) {
        // Between two of its jobs a study runs.
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

impl From<StudyRow> for StudyView {
    fn from(row: StudyRow) -> Self {
        let there: u64 = row.counts.values().sum();
        let ended: u64 = row.counts.iter().filter(|(state, _)| state.is_terminal()).map(|(_, count)| count).sum();
        let deleted = row.points.saturating_sub(there);
        let mut counts: BTreeMap<String, u64> =
            row.counts.iter().map(|(state, count)| (state.word().to_owned(), *count)).collect();
        if deleted > 0 {
            counts.insert("deleted".to_owned(), deleted);
        }
        let base = format!("/v1/studies/{}", row.id);
        let mut links = BTreeMap::from([("self", base.clone())]);
        for name in ["jobs", "events", "table", "report", "cancel", "pause", "resume", "retry"] {
            links.insert(name, format!("{base}/{name}"));
        }
        Self {
            state: state_of(&row.counts),
            fraction: (ended + deleted) as f64 / row.points.max(1) as f64,
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
            estimate: row.estimate,
            created_at: row.created_at,
            links,
        }
    }
}

impl From<UploadRow> for UploadView {
    fn from(row: UploadRow) -> Self {
        let links = BTreeMap::from([("self", format!("/v1/uploads/{}", row.id))]);
        Self {
            id: row.id,
            r#as: row.purpose.word(),
            state: row.state,
            reason: row.reason,
            found: row.found,
            name: row.name,
            size_bytes: row.size_bytes,
            sha256: row.sha256,
            created_at: row.created_at,
            checked_at: row.checked_at,
            links,
        }
    }
}
