//! What clients see: the only wire types.

/// Declares the view of a list.
macro_rules! list {
    ($(#[$doc:meta])* $name:ident of $item:ident, next: $next:literal) => {
        $(#[$doc])*
        #[derive(Debug, Serialize, ToSchema)]
        pub struct $name {
            /// The entries.
            pub items: Vec<$item>,
            #[doc = $next]
            pub next: Option<String>,
        }

        impl From<(Vec<$item>, Option<String>)> for $name {
            fn from((items, next): (Vec<$item>, Option<String>)) -> Self {
                Self { items, next }
            }
        }
    };
}

mod collections;

pub use collections::{DryRunView, EstimateView, StudyList, StudyView, UploadList, UploadView};

use meniscus_jobs::service::store::{CheckpointRow, Event, FileRow, JobRow};
use meniscus_jobs::spec::records::{HealthRecord, Progress, Usage};
use meniscus_jobs::system::build;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// A job.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobView {
    /// `job_` and a ULID.
    pub id: String,
    /// Rises with every change of state.
    pub rev: i64,
    /// `queued`, `running`, `pausing`, `paused`, `canceling`, `interrupted`, `succeeded`, `failed` or `canceled`.
    pub state: String,
    /// Why, unless the state is plain.
    pub reason: Option<String>,
    /// What to do about it.
    pub hint: Option<String>,
    /// Numbers and places of a failure.
    pub message: Option<String>,
    /// Name.
    pub name: Option<String>,
    /// Labels.
    pub labels: BTreeMap<String, String>,
    /// The body as sent.
    pub spec: Value,
    /// The body with every default.
    pub resolved: Value,
    /// How far it is.
    pub progress: ProgressView,
    /// How sound it looks.
    pub health: HealthView,
    /// Number of the latest attempt.
    pub attempt: u64,
    /// Cost so far.
    pub usage: UsageView,
    /// Where it comes from.
    pub lineage: LineageView,
    /// What its numbers depend on.
    pub deterministic: DeterministicView,
    /// RFC 3339, UTC.
    pub created_at: String,
    /// RFC 3339, UTC.
    pub started_at: Option<String>,
    /// RFC 3339, UTC.
    pub finished_at: Option<String>,
    /// Where to go from here.
    pub links: BTreeMap<&'static str, String>,
}

/// How far a job is.
#[derive(Debug, Serialize, ToSchema)]
pub struct ProgressView {
    /// 0 to 1; never falls.
    pub fraction: f64,
    /// Scene time.
    pub time: f64,
    /// Scene time at the end.
    pub end_time: f64,
    /// Steps done.
    pub step: u64,
    /// Speed of late.
    pub steps_per_s: Option<f64>,
    /// Particles.
    pub particles: u64,
    /// What is being done.
    pub phase: String,
    /// Seconds to the end.
    pub eta_s: Option<f64>,
    /// What the estimate rests on.
    pub eta_basis: Option<String>,
}

/// How sound a job looks.
#[derive(Debug, Serialize, ToSchema)]
pub struct HealthView {
    /// All numbers are finite.
    pub finite: bool,
    /// Longest way of a particle in a step, in spacings.
    pub max_cfl: f64,
    /// Relative change of the enclosed measure.
    pub volume_drift: Option<f64>,
    /// Rescued fits and queries.
    pub rescued_fits: u64,
    /// Things to know.
    pub warnings: Vec<String>,
}

/// Cost of a job.
#[derive(Debug, Serialize, ToSchema)]
pub struct UsageView {
    /// Running time.
    pub wall_s: f64,
    /// CPU time.
    pub cpu_s: f64,
    /// Most resident memory.
    pub peak_memory_bytes: u64,
    /// Size of all files.
    pub disk_bytes: u64,
}

/// Where a job comes from.
#[derive(Debug, Serialize, ToSchema)]
pub struct LineageView {
    /// Study.
    pub study: Option<String>,
    /// Checkpoint that it began with.
    pub restarted_from: Option<String>,
    /// Job that it repeats.
    pub retry_of: Option<String>,
}

/// What a job's numbers depend on.
#[derive(Debug, Serialize, ToSchema)]
pub struct DeterministicView {
    /// Program.
    pub build: String,
    /// Instruction set.
    pub isa: String,
}

list! {
    /// A page of jobs.
    JobList of JobView, next: "Cursor of the next page."
}

/// An event.
#[derive(Debug, Serialize, ToSchema)]
pub struct EventView {
    /// Number within the job (or the study), from 1 without gaps.
    pub id: u64,
    /// The job, in the events of a study.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub job: Option<String>,
    /// `state`, `progress`, `checkpoint`, `frame`, `warning` or `finding`.
    pub r#type: String,
    /// RFC 3339, UTC.
    pub at: String,
    /// Attempt.
    pub attempt: u64,
    /// Particulars.
    pub data: Value,
}

/// A page of events.
#[derive(Debug, Serialize, ToSchema)]
pub struct EventList {
    /// The events.
    pub items: Vec<EventView>,
    /// Value of `after` for the next page.
    pub next: Option<u64>,
}

/// A published file.
#[derive(Debug, Serialize, ToSchema)]
pub struct FileView {
    /// Path among the job's files.
    pub path: String,
    /// Bytes.
    pub size_bytes: u64,
    /// Digest.
    pub sha256: String,
    /// Media type.
    pub media_type: String,
    /// Scene time.
    pub time: Option<f64>,
    /// Step.
    pub step: Option<u64>,
}

list! {
    /// All published files of a job.
    FileList of FileView, next: "Always null: the list is whole."
}

/// A verified checkpoint.
#[derive(Debug, Serialize, ToSchema)]
pub struct CheckpointView {
    /// `ckpt_` and a ULID.
    pub id: String,
    /// Job that wrote it.
    pub job: String,
    /// Step.
    pub step: u64,
    /// Scene time.
    pub time: f64,
    /// Bytes.
    pub size_bytes: u64,
    /// Digest.
    pub sha256: String,
    /// RFC 3339, UTC.
    pub created_at: String,
    /// Instruction set.
    pub isa: String,
    /// Program.
    pub build: String,
    /// Where to go from here.
    pub links: BTreeMap<&'static str, String>,
}

list! {
    /// All checkpoints of a job, newest first.
    CheckpointList of CheckpointView, next: "Always null: the list is whole."
}

/// What the service is.
#[derive(Debug, Serialize, ToSchema)]
pub struct ServiceView {
    /// Always `meniscus`.
    pub name: &'static str,
    /// Version and commit.
    pub build: String,
    /// Instruction set of the numerics.
    pub isa: String,
    /// What a job may ask for.
    pub limits: ServiceLimits,
    /// Where to go from here.
    pub links: BTreeMap<&'static str, &'static str>,
}

/// What a job may ask for.
#[derive(Debug, Serialize, ToSchema)]
pub struct ServiceLimits {
    /// Jobs at once.
    pub slots: usize,
    /// Threads of a job.
    pub threads: u64,
    /// Memory of a job.
    pub memory_bytes: u64,
    /// Bytes of a request's body.
    pub body_bytes: usize,
    /// Bytes of a study's body.
    pub study_bytes: usize,
    /// Bytes of an upload.
    pub upload_bytes: u64,
}

/// A kind of scene.
#[derive(Debug, Serialize, ToSchema)]
pub struct SceneKindView {
    /// The `kind`.
    pub kind: &'static str,
    /// One line.
    pub title: &'static str,
    /// JSON Schema 2020-12 with defaults and ranges.
    pub schema: Value,
    /// Presets.
    pub presets: Vec<&'static str>,
    /// Fields that a restart may change.
    pub restart_safe: Vec<String>,
    /// A job body that runs in seconds.
    pub example: Value,
}

list! {
    /// All kinds of scenes.
    SceneKindList of SceneKindView, next: "Always null: the list is whole."
}

/// Whether the service lives or is ready.
#[derive(Debug, Serialize, ToSchema)]
pub struct StatusView {
    /// `ok`.
    pub status: &'static str,
}

impl From<JobRow> for JobView {
    fn from(job: JobRow) -> Self {
        let base = format!("/v1/jobs/{}", job.id);
        let mut links = BTreeMap::from([("self", base.clone())]);
        for name in ["cancel", "pause", "resume", "events", "log", "series", "report", "files", "checkpoints"] {
            links.insert(name, format!("{base}/{name}"));
        }
        let Progress {
            fraction,
            time,
            end_time,
            step,
            steps_per_s,
            particles,
            phase,
            eta_s,
            eta_basis,
            health,
            usage: _,
        } = job.progress;
        // A job at rest has no speed.
        let moving = job.state.has_worker();
        let HealthRecord { finite, max_cfl, volume_drift, rescued_fits } = health;
        let Usage { wall_s, cpu_s, peak_memory_bytes, disk_bytes } = job.usage;
        let end_time = if end_time > 0.0 {
            end_time
        } else {
            let estimate = |name: &str| job.estimate[name].as_f64().unwrap_or(0.0);
            estimate("steps") * estimate("time_step")
        };
        Self {
            rev: job.rev,
            state: job.state.word().to_owned(),
            reason: job.reason.map(|reason| reason.word().to_owned()),
            hint: job.hint,
            message: job.message,
            name: job.name,
            labels: job.labels,
            spec: job.spec,
            resolved: job.resolved,
            progress: ProgressView {
                fraction,
                time,
                end_time,
                step,
                steps_per_s: steps_per_s.filter(|_| moving),
                particles: if particles > 0 { particles } else { job.estimate["particles"].as_u64().unwrap_or(0) },
                phase: if moving { phase } else { job.state.word().to_owned() },
                eta_s: eta_s.filter(|_| moving),
                eta_basis: eta_basis.filter(|_| moving),
            },
            health: HealthView { finite, max_cfl, volume_drift, rescued_fits, warnings: job.warnings },
            attempt: job.attempt,
            usage: UsageView { wall_s, cpu_s, peak_memory_bytes, disk_bytes },
            lineage: LineageView { study: job.study, restarted_from: job.restarted_from, retry_of: job.retry_of },
            deterministic: DeterministicView { build: build::name(), isa: build::isa() },
            created_at: job.created_at,
            started_at: job.started_at,
            finished_at: job.finished_at,
            links,
            id: job.id,
        }
    }
}

impl From<Event> for EventView {
    fn from(event: Event) -> Self {
        let Event { id, kind, at, attempt, data } = event;
        Self { id, job: None, r#type: kind, at, attempt, data }
    }
}

impl From<FileRow> for FileView {
    fn from(file: FileRow) -> Self {
        let FileRow { path, attempt: _, size_bytes, sha256, media_type, time, step, content: _ } = file;
        Self { path, size_bytes, sha256, media_type, time, step }
    }
}

impl From<CheckpointRow> for CheckpointView {
    fn from(row: CheckpointRow) -> Self {
        let CheckpointRow { id, job, attempt: _, path: _, step, time, size_bytes, sha256, created_at, isa, build } =
            row;
        let base = format!("/v1/checkpoints/{id}");
        let links = BTreeMap::from([
            ("content", format!("{base}/content")),
            ("self", base),
            ("job", format!("/v1/jobs/{job}")),
        ]);
        Self { id, job, step, time, size_bytes, sha256, created_at, isa, build, links }
    }
}
