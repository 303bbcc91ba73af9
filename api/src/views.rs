//! The JSON that clients receive: the only wire types of the API.

/// Declares the view of a list.
macro_rules! list {
    ($(#[$doc:meta])* $name:ident of $item:ident, next: $next:literal) => {
        $(#[$doc])*
        #[derive(Debug, Serialize, ToSchema)]
        pub struct $name {
            /// Entries of the page.
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
mod health;

pub use collections::{DryRunView, EstimateView, StudyList, StudyView, UploadList, UploadView};
pub use health::{FindingView, HealthView, QuantityView, ReportView};

use crate::base_path::address;
use meniscus_jobs::service::store::{CheckpointRow, Event, FileRow, JobRow};
use meniscus_jobs::spec::records::{Progress, Usage};
use meniscus_jobs::spec::states::State;
use meniscus_jobs::system::build;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// A job: one simulation with its state, its progress and links to its results.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobView {
    /// `job_` and a ULID.
    pub id: String,
    /// Revision; rises with every change of state.
    pub rev: i64,
    /// `queued`, `running`, `pausing`, `paused`, `canceling`, `interrupted`, `succeeded`, `failed` or `canceled`.
    pub state: String,
    /// Reason of the state, from a closed list; null where the state needs none.
    pub reason: Option<String>,
    /// What the client can do about the reason.
    pub hint: Option<String>,
    /// What failed, with numbers and places.
    pub message: Option<String>,
    /// Name that the client gave.
    pub name: Option<String>,
    /// Labels that the client gave.
    pub labels: BTreeMap<String, String>,
    /// The body as sent.
    pub spec: Value,
    /// The body with every default filled in; null as long as a study of its own looks for its spacing.
    pub resolved: Value,
    /// Progress of the run.
    pub progress: ProgressView,
    /// Whether its results can be trusted.
    pub health: HealthView,
    /// What was known before it ran, and remarks of the service.
    pub warnings: Vec<FindingView>,
    /// Number of the latest attempt, from 1; 0 before the first.
    pub attempt: u64,
    /// Resources used so far.
    pub usage: UsageView,
    /// What a job waits for, in the queue or in that of a cluster (`slurm (Priority)`); the id of a study where that finds its spacing.
    pub waiting_for: Option<String>,
    /// Ids of jobs that must have succeeded before it starts.
    pub after: Vec<String>,
    /// Name of the token that made it; null without tokens.
    pub owner: Option<String>,
    /// Objects that the job was made from.
    pub lineage: LineageView,
    /// Build and instruction set, on which the last digits of results depend.
    pub deterministic: DeterministicView,
    /// Time of creation (RFC 3339, UTC).
    pub created_at: String,
    /// Start of the first attempt (RFC 3339, UTC).
    pub started_at: Option<String>,
    /// Time at which the job ended (RFC 3339, UTC).
    pub finished_at: Option<String>,
    /// Addresses of related resources.
    pub links: BTreeMap<&'static str, String>,
}

/// Progress of a job.
#[derive(Debug, Serialize, ToSchema)]
pub struct ProgressView {
    /// Share of the run that is done, from 0 to 1; never decreases.
    pub fraction: f64,
    /// Simulated time, in units of the scene.
    pub time: f64,
    /// Simulated time at which the run ends.
    pub end_time: f64,
    /// Completed steps.
    pub step: u64,
    /// Recent speed in steps per second; null while no worker runs.
    pub steps_per_s: Option<f64>,
    /// Number of particles.
    pub particles: u64,
    /// What the worker does at the moment, or the state of the job.
    pub phase: String,
    /// Estimated seconds until the run ends; null while no worker runs.
    pub eta_s: Option<f64>,
    /// Measurements on which the estimate rests.
    pub eta_basis: Option<String>,
}

/// Resources that a job has used.
#[derive(Debug, Serialize, ToSchema)]
pub struct UsageView {
    /// Wall-clock time of all attempts in seconds.
    pub wall_s: f64,
    /// CPU time of all attempts in seconds.
    pub cpu_s: f64,
    /// Largest resident memory in bytes.
    pub peak_memory_bytes: u64,
    /// Size of all files in bytes.
    pub disk_bytes: u64,
}

/// Objects that a job was made from.
#[derive(Debug, Serialize, ToSchema)]
pub struct LineageView {
    /// Id of the study that the job belongs to, or that found its spacing.
    pub study: Option<String>,
    /// Id of the checkpoint that the job started from.
    pub restarted_from: Option<String>,
    /// Id of the failed or canceled job that this job repeats.
    pub retry_of: Option<String>,
}

/// Build and instruction set: equal values give equal results to the last bit.
#[derive(Debug, Serialize, ToSchema)]
pub struct DeterministicView {
    /// Version and commit of the program.
    pub build: String,
    /// Instruction set of the numerics.
    pub isa: String,
}

list! {
    /// A page of jobs.
    JobList of JobView, next: "Cursor of the next page."
}

/// An event in the life of a job.
#[derive(Debug, Serialize, ToSchema)]
pub struct EventView {
    /// Number within the job (or the study), from 1 without gaps.
    pub id: u64,
    /// Id of the job, in the events of a study.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub job: Option<String>,
    /// `state`, `progress`, `checkpoint`, `frame`, `warning` or `finding`.
    pub r#type: String,
    /// Time of the event (RFC 3339, UTC).
    pub at: String,
    /// Number of the attempt during which it happened.
    pub attempt: u64,
    /// Data of the event; its fields depend on the type.
    pub data: Value,
}

/// A page of events.
#[derive(Debug, Serialize, ToSchema)]
pub struct EventList {
    /// Events in the order of their numbers.
    pub items: Vec<EventView>,
    /// Value of `after` for the next page.
    pub next: Option<u64>,
}

/// A file that a job has published.
#[derive(Debug, Serialize, ToSchema)]
pub struct FileView {
    /// Path below `/v1/jobs/{id}/files/`.
    pub path: String,
    /// Size in bytes.
    pub size_bytes: u64,
    /// SHA-256 of the content, hexadecimal.
    pub sha256: String,
    /// Media type of the content.
    pub media_type: String,
    /// Simulated time that the file shows; null where it shows none.
    pub time: Option<f64>,
    /// Step that the file shows; null where it shows none.
    pub step: Option<u64>,
}

list! {
    /// All published files of a job.
    FileList of FileView, next: "Always null: the list is whole."
}

/// A checkpoint that was verified after it was written.
#[derive(Debug, Serialize, ToSchema)]
pub struct CheckpointView {
    /// `ckpt_` and a ULID.
    pub id: String,
    /// Id of the job that wrote it.
    pub job: String,
    /// Step after which it was written.
    pub step: u64,
    /// Simulated time of that step.
    pub time: f64,
    /// Size in bytes.
    pub size_bytes: u64,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
    /// Time of creation (RFC 3339, UTC).
    pub created_at: String,
    /// Instruction set of the machine that wrote it.
    pub isa: String,
    /// Version and commit of the program that wrote it.
    pub build: String,
    /// Addresses of related resources.
    pub links: BTreeMap<&'static str, String>,
}

list! {
    /// All checkpoints of a job, newest first.
    CheckpointList of CheckpointView, next: "Always null: the list is whole."
}

/// Version and limits of the service.
#[derive(Debug, Serialize, ToSchema)]
pub struct ServiceView {
    /// Always `meniscus`.
    pub name: &'static str,
    /// Version and commit of the program.
    pub build: String,
    /// Instruction set of the numerics.
    pub isa: String,
    /// Limits of requests and jobs.
    pub limits: ServiceLimits,
    /// Addresses of related resources.
    pub links: BTreeMap<&'static str, String>,
}

/// Limits of requests and jobs.
#[derive(Debug, Serialize, ToSchema)]
pub struct ServiceLimits {
    /// Jobs that run at the same time.
    pub slots: usize,
    /// Most threads of a job.
    pub threads: u64,
    /// Largest memory of a job in bytes.
    pub memory_bytes: u64,
    /// Largest body of a job in bytes.
    pub body_bytes: usize,
    /// Largest body of a study in bytes.
    pub study_bytes: usize,
    /// Largest upload in bytes.
    pub upload_bytes: u64,
}

/// A kind of scene.
#[derive(Debug, Serialize, ToSchema)]
pub struct SceneKindView {
    /// Value of `kind` in a scene.
    pub kind: &'static str,
    /// Title in one line.
    pub title: &'static str,
    /// JSON Schema 2020-12 with defaults and ranges.
    pub schema: Value,
    /// Names of presets.
    pub presets: Vec<&'static str>,
    /// JSON pointers of the fields that a restart may change.
    pub restart_safe: Vec<String>,
    /// Fields of frames.
    pub fields: Vec<QuantityView>,
    /// Scalars of the series.
    pub observables: Vec<QuantityView>,
    /// Norms of the errors in reports.
    pub norms: Vec<QuantityView>,
    /// A job body that runs within seconds.
    pub example: Value,
}

list! {
    /// All kinds of scenes.
    SceneKindList of SceneKindView, next: "Always null: the list is whole."
}

/// What an action on many jobs came to.
#[derive(Debug, Serialize, ToSchema)]
pub struct ActionView {
    /// Jobs that the filter matches.
    pub matched: u64,
    /// Jobs that were changed, or would be.
    pub changed: u64,
    /// Whether nothing was changed.
    pub dry_run: bool,
    /// Jobs that were left as they are, a thousand at most.
    pub skipped: Vec<SkippedView>,
}

/// A job that an action left as it is.
#[derive(Debug, Serialize, ToSchema)]
pub struct SkippedView {
    /// Id of the job.
    pub job: String,
    /// Why it was left.
    pub reason: String,
}

/// A ticket.
#[derive(Debug, Serialize, ToSchema)]
pub struct TicketView {
    /// The value of `?ticket=`.
    pub ticket: String,
    /// Time from which on it is not accepted any more (RFC 3339, UTC).
    pub expires_at: String,
}

/// Answer of a health check.
#[derive(Debug, Serialize, ToSchema)]
pub struct StatusView {
    /// Always `ok`.
    pub status: &'static str,
}

/// The address of an object, and those of its parts.
fn links(base: String, parts: &[&'static str]) -> BTreeMap<&'static str, String> {
    let below = parts.iter().map(|part| (*part, format!("{base}/{part}")));
    let mut links: BTreeMap<_, _> = below.collect();
    links.insert("self", base);
    links
}

/// What a job waits for in the queue, or in that of a cluster.
fn waiting_for(job: &JobRow) -> Option<String> {
    if job.state.has_worker() {
        return job.waiting_for.clone();
    }
    let study = job.awaits.clone().filter(|_| job.resolved.is_null());
    (job.state == State::Queued).then(|| match (job.waits_for, &job.hint) {
        (1.., _) if study.is_some() => study.unwrap_or_default(),
        (0, Some(_)) => "another try to start it (see hint)".to_owned(),
        (0, None) => "a free slot, its memory and its disk space".to_owned(),
        (1, _) => "one job of `after` to succeed".to_owned(),
        (count, _) => format!("{count} jobs of `after` to succeed"),
    })
}

impl From<JobRow> for JobView {
    fn from(job: JobRow) -> Self {
        let parts = ["cancel", "pause", "resume", "retry", "events", "log", "series", "report", "files", "checkpoints"];
        let links = links(address(&format!("/v1/jobs/{}", job.id)), &parts);
        let waiting_for = waiting_for(&job);
        let study = job.study.or(job.awaits);
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
        // Speed and remaining time have a meaning only while a worker runs.
        let is_running = job.state.has_worker();
        let Usage { wall_s, cpu_s, peak_memory_bytes, disk_bytes } = job.usage;
        let end_time = if end_time > 0.0 { end_time } else { job.forecast.steps as f64 * job.forecast.time_step };
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
                steps_per_s: steps_per_s.filter(|_| is_running),
                particles: if particles > 0 { particles } else { job.forecast.particles },
                phase: if is_running { phase } else { job.state.word().to_owned() },
                eta_s: eta_s.filter(|_| is_running),
                eta_basis: eta_basis.filter(|_| is_running),
            },
            health: HealthView::new(health, job.health, job.findings),
            warnings: job.warnings.into_iter().map(FindingView::from).collect(),
            attempt: job.attempt,
            waiting_for,
            after: job.predecessors,
            owner: job.owner,
            usage: UsageView { wall_s, cpu_s, peak_memory_bytes, disk_bytes },
            lineage: LineageView { study, restarted_from: job.restarted_from, retry_of: job.retry_of },
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
        let base = address(&format!("/v1/checkpoints/{id}"));
        let links = BTreeMap::from([
            ("content", format!("{base}/content")),
            ("self", base),
            ("job", address(&format!("/v1/jobs/{job}"))),
        ]);
        Self { id, job, step, time, size_bytes, sha256, created_at, isa, build, links }
    }
}
