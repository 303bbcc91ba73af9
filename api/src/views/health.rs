//! Health of jobs, reports and declared quantities, as clients see them.

use meniscus::simulation::{Check, Finding, Quantity, Severity};
use meniscus_jobs::spec::health::{HealthRecord, HealthStatus};
use serde::Serialize;
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// Whether a job's results can be trusted, and what speaks against them.
#[derive(Debug, Serialize, ToSchema)]
pub struct HealthView {
    /// `sound`, or `doubtful` where a check does not hold or a finding is a warning; null before the first look.
    pub status: Option<&'static str>,
    /// Whether all numbers are finite.
    pub finite: bool,
    /// Longest way of a particle in a step, in spacings.
    pub max_cfl: f64,
    /// Relative change of the enclosed area or volume, where it is known.
    pub volume_drift: Option<f64>,
    /// What the scheme watches.
    pub checks: Vec<CheckView>,
    /// What the run noticed, in order.
    pub findings: Vec<FindingView>,
}

/// An invariant that a scheme watches.
#[derive(Debug, Serialize, ToSchema)]
pub struct CheckView {
    /// Name.
    pub name: String,
    /// Its present value; null before it was measured.
    pub value: Option<f64>,
    /// The bound that it must keep; null where the value is only watched.
    pub limit: Option<f64>,
    /// Unit of value and limit; empty where there is none.
    pub unit: String,
    /// Whether it holds; null before it was measured, or without a limit.
    pub holds: Option<bool>,
}

/// Something that a run noticed.
#[derive(Debug, Serialize, ToSchema)]
pub struct FindingView {
    /// Short name, such as `front_open`.
    pub code: String,
    /// `info` for events of the physics, `warning` for doubts about the results.
    pub severity: &'static str,
    /// A sentence with numbers.
    pub message: String,
    /// How many points, or events, it is about.
    pub count: u64,
    /// The first few of the points, by their index in the frame of that step.
    pub points: Vec<u64>,
    /// Scene time.
    pub time: f64,
    /// Step.
    pub step: u64,
    /// What may be done about it.
    pub advice: Option<String>,
}

/// The report of a finished job.
#[derive(Debug, Serialize, ToSchema)]
pub struct ReportView {
    /// Errors against exact answers, in the order of their times.
    pub errors: Vec<ErrorView>,
    /// Cost of the whole run, over all attempts.
    pub cost: CostView,
    /// Invariants at the end, and what was noticed.
    pub health: HealthView,
    /// What the method counted of its own work.
    pub diagnostics: Vec<DiagnosticView>,
    /// What came of the accuracy that was asked for; null where none was.
    pub accuracy: Option<AccuracyView>,
    /// Outcomes of automatic choices, and their reasons.
    pub method: BTreeMap<String, String>,
    /// Where the numbers come from.
    pub provenance: ProvenanceView,
}

/// What came of an accuracy that was asked for.
#[derive(Debug, Serialize, ToSchema)]
pub struct AccuracyView {
    /// The quantity as sent.
    pub quantity: serde_json::Value,
    /// The tolerance.
    pub tolerance: f64,
    /// Predicted error.
    pub predicted: f64,
    /// Error that was reached, known or estimated; null where it cannot be told.
    pub reached: Option<f64>,
    /// Whether the tolerance is met.
    pub met: bool,
}

/// An error against a reference.
#[derive(Debug, Serialize, ToSchema)]
pub struct ErrorView {
    /// Compared quantity.
    pub quantity: String,
    /// Norm; the scene's kind declares what each means.
    pub norm: String,
    /// The error.
    pub value: Option<f64>,
    /// Scene time.
    pub time: f64,
    /// Reference of the comparison.
    pub reference: String,
}

/// Cost of a run.
#[derive(Debug, Serialize, ToSchema)]
pub struct CostView {
    /// Running time.
    pub wall_s: f64,
    /// CPU time.
    pub cpu_s: f64,
    /// Steps.
    pub steps: u64,
    /// Particles by steps by running time.
    pub particle_steps_per_s: f64,
    /// Most resident memory.
    pub peak_memory_bytes: u64,
    /// Exclusive CPU seconds by path-like names.
    pub phases: BTreeMap<String, f64>,
}

/// A number that a method counts or measures about its own work.
#[derive(Debug, Serialize, ToSchema)]
pub struct DiagnosticView {
    /// Path-like name, such as `fits.larger_radius`.
    pub name: String,
    /// The number.
    pub value: Option<f64>,
    /// Unit; empty where there is none.
    pub unit: String,
    /// What it is, in a sentence.
    pub doc: String,
}

/// Where the numbers of a run come from.
#[derive(Debug, Serialize, ToSchema)]
pub struct ProvenanceView {
    /// Version and commit of the program.
    pub build: String,
    /// Processor, where the system names it.
    pub cpu: Option<String>,
    /// Instruction set of the numerics.
    pub isa: String,
    /// Threads.
    pub threads: usize,
    /// Digest of the resolved scene.
    pub scene_sha256: String,
}

/// A quantity that a kind of scene declares.
#[derive(Debug, Serialize, ToSchema)]
pub struct QuantityView {
    /// Name in frames, series and reports.
    pub name: &'static str,
    /// Unit in terms of the scene's own (`length`, `time`, `mass`); empty where there is none.
    pub unit: &'static str,
    /// What it is, in a sentence.
    pub doc: &'static str,
}

impl HealthView {
    /// The health of a job from its last record, its status and its findings.
    #[must_use]
    pub fn new(record: HealthRecord, status: Option<HealthStatus>, findings: Vec<Finding>) -> Self {
        let HealthRecord { finite, max_cfl, volume_drift, checks, .. } = record;
        Self {
            status: status.map(HealthStatus::word),
            finite,
            max_cfl,
            volume_drift,
            checks: checks.into_iter().map(CheckView::from).collect(),
            findings: findings.into_iter().map(FindingView::from).collect(),
        }
    }
}

impl From<Check> for CheckView {
    fn from(check: Check) -> Self {
        let Check { name, value, limit, unit, holds } = check;
        Self { name: name.into_owned(), value, limit, unit: unit.into_owned(), holds }
    }
}

impl From<Finding> for FindingView {
    fn from(finding: Finding) -> Self {
        let Finding { code, severity, message, count, points, time, step, advice } = finding;
        let severity = match severity {
            Severity::Info => "info",
            Severity::Warning => "warning",
        };
        let (code, advice) = (code.into_owned(), advice.map(std::borrow::Cow::into_owned));
        Self { code, severity, message, count, points, time, step, advice }
    }
}

impl From<&'static Quantity> for QuantityView {
    fn from(quantity: &'static Quantity) -> Self {
        let Quantity { name, unit, doc } = quantity;
        Self { name, unit, doc }
    }
}
