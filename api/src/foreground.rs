//! `meniscus run` and `meniscus resume`: one job, or the runs of a verification case, in this process, with a progress
//! bar and no service.

mod case;

use indicatif::{ProgressBar, ProgressStyle};
use meniscus::simulation::ErrorEntry;
use meniscus_jobs::formats::checkpoint;
use meniscus_jobs::spec::attempt_files::REPORT;
use meniscus_jobs::spec::attempt_spec::{AttemptSpec, StartCheckpoint};
use meniscus_jobs::spec::body::{self, Allowance, NoSources, ResolvedBody};
use meniscus_jobs::spec::health::HealthStatus;
use meniscus_jobs::spec::records::{CheckpointRecord, Record, RecordSink, Usage, Verdict};
use meniscus_jobs::spec::report::{Cost, RunReport};
use meniscus_jobs::spec::strict_json;
use meniscus_jobs::system::process;
use meniscus_jobs::verify::{self, CaseError};
use meniscus_jobs::worker::attempt;
use meniscus_jobs::worker::observers::Control;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Why a run in the foreground did not begin.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The file cannot be read or used.
    #[error("{path}: {cause}")]
    File {
        /// Path of the file.
        path: String,
        /// What is wrong with it.
        cause: String,
    },
    /// The body is not valid.
    #[error("{0}")]
    Invalid(String),
    /// The file is not a valid verification case.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The directory for the results is not empty.
    #[error("the directory {0} is not empty; give --out a new or empty directory")]
    NotEmpty(String),
    /// The system failed.
    #[error("{0}")]
    Io(#[from] io::Error),
}

/// Runs a job body, a bare scene or the runs of a verification case from a file.
///
/// # Errors
/// [`RunError`].
pub fn run(file: &Path, out: &Path, threads: Option<usize>) -> Result<ExitCode, RunError> {
    let cannot = |cause: String| RunError::File { path: file.display().to_string(), cause };
    let bytes = std::fs::read(file).map_err(|error| cannot(error.to_string()))?;
    let value = strict_json::parse(&bytes).map_err(|error| cannot(error.to_string()))?;
    if verify::case::is_case(&value) {
        return case::run(file, &bytes, out, threads);
    }
    start(&resolve(&verify::case::job_body(&value), threads)?, Vec::new(), out).map(exit_code)
}

fn exit_code(has_succeeded: bool) -> ExitCode {
    if has_succeeded { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Continues from a checkpoint to the end of its scene.
///
/// # Errors
/// [`RunError`].
pub fn resume(file: &Path, out: &Path, threads: Option<usize>) -> Result<ExitCode, RunError> {
    let cannot = |cause: String| RunError::File { path: file.display().to_string(), cause };
    let (meta, _) = checkpoint::read(file, None).map_err(|error| cannot(error.to_string()))?;
    let mut spec = meta.body;
    if let Some(map) = spec.as_object_mut() {
        map.shift_remove("restart");
        // The limits are those of the machine that wrote the checkpoint.
        map.shift_remove("limits");
        // The spacing was chosen.
        map.shift_remove("accuracy");
    }
    let path = std::fs::canonicalize(file)?;
    let candidate =
        StartCheckpoint { id: file.display().to_string(), path, sha256: None, is_own: false, allow_other_isa: false };
    start(&resolve(&spec, threads)?, vec![candidate], out).map(exit_code)
}

fn resolve(spec: &Value, threads: Option<usize>) -> Result<ResolvedBody, RunError> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let allowance = Allowance {
        threads: threads.unwrap_or(cores) as u64,
        memory_bytes: process::total_memory().unwrap_or(4 << 30) / 5 * 4,
        local_files: true,
    };
    let body = body::parse(spec, allowance, &NoSources).map_err(|error| {
        let violations = error.violations();
        let lines: Vec<String> = violations
            .iter()
            .map(|v| {
                let hint = v.did_you_mean.as_ref().map(|name| format!(" (did you mean {name}?)")).unwrap_or_default();
                let allowed = if v.allowed.is_null() { String::new() } else { format!("; allowed: {}", v.allowed) };
                format!("{}: {} (got {}){allowed}{hint}", v.pointer, v.detail, v.got)
            })
            .collect();
        RunError::Invalid(lines.join("\n"))
    })?;
    if body.wanted.is_some() {
        let message = "/accuracy: a study chooses the spacing, which only the service runs; give a spacing";
        return Err(RunError::Invalid(message.to_owned()));
    }
    Ok(body.resolved)
}

/// Runs a resolved body into a directory, new or empty, and prints its errors. Returns whether it succeeded.
fn start(resolved: &ResolvedBody, checkpoints: Vec<StartCheckpoint>, out: &Path) -> Result<bool, RunError> {
    std::fs::create_dir_all(out)?;
    if std::fs::read_dir(out)?.next().is_some() {
        return Err(RunError::NotEmpty(out.display().to_string()));
    }
    let out = std::fs::canonicalize(out)?;
    let attempt_spec = AttemptSpec {
        job: "foreground".to_owned(),
        epoch: 1,
        body: resolved.to_json(),
        attempts_directory: out.clone(),
        may_start_afresh: checkpoints.is_empty(),
        checkpoints,
        inputs: BTreeMap::new(),
        time: None,
        reserve_bytes: 0,
        late_files_s: 0.0,
        usage: Usage::default(),
        submission: None,
    };
    let keep = resolved.options.checkpoint.keep as usize;
    let mut sink = Screen::new(out.clone(), keep);
    let verdict = attempt::run_attempt(&attempt_spec, &out, &Control::default(), &mut sink);
    sink.bar.finish_and_clear();
    let mut output = io::stdout().lock();
    match verdict {
        Verdict::Succeeded => {
            let report: RunReport =
                serde_json::from_slice(&std::fs::read(out.join(REPORT))?).map_err(io::Error::from)?;
            for ErrorEntry { quantity, norm, value, time, .. } in &report.errors {
                writeln!(output, "{quantity:<14} {norm:<9} {value:.3e}  at t = {time:?}")?;
            }
            let Cost { wall_s, cpu_s, steps, .. } = report.cost;
            writeln!(output, "wall {wall_s:.2} s, cpu {cpu_s:.2} s, {steps} steps")?;
            if report.health.status == Some(HealthStatus::Doubtful) {
                writeln!(output, "the results are doubtful: see the warnings above, or health in {REPORT}")?;
            }
            writeln!(output, "results in {}", out.display())?;
            Ok(true)
        }
        Verdict::Failed { reason, message } => stopped(&format!("the run failed ({}): {message}", reason.word())),
        Verdict::Paused { reason } => {
            let reason = reason.map(|reason| format!(" ({})", reason.word())).unwrap_or_default();
            stopped(&format!("the run paused after a checkpoint{reason}; `meniscus resume` continues it"))
        }
        Verdict::Canceled => stopped("the run was canceled"),
        Verdict::Unstarted { cause } => stopped(&format!("the system did not grant what the run needs: {cause}")),
    }
}

/// Says on standard error why a run ended early.
fn stopped(why: &str) -> Result<bool, RunError> {
    writeln!(io::stderr(), "meniscus: {why}")?;
    Ok(false)
}

/// Shows records on a terminal and keeps the newest checkpoints.
struct Screen {
    bar: ProgressBar,
    out: PathBuf,
    keep: usize,
    checkpoints: Vec<CheckpointRecord>,
}

impl Screen {
    fn new(out: PathBuf, keep: usize) -> Self {
        let bar = ProgressBar::new(1000);
        if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent:>3} %  {msg}") {
            bar.set_style(style);
        }
        Self { bar, out, keep, checkpoints: Vec::new() }
    }
}

impl Screen {
    /// Writes a line to standard error, above the bar where there is one.
    fn say(&self, line: &str) -> io::Result<()> {
        if self.bar.is_hidden() {
            return writeln!(io::stderr(), "{line}");
        }
        self.bar.println(line);
        Ok(())
    }
}

impl RecordSink for Screen {
    fn put(&mut self, record: &Record, _durable: bool) -> io::Result<()> {
        match record {
            Record::Progress(progress) => {
                self.bar.set_position((1000.0 * progress.fraction) as u64);
                let eta = progress.eta_s.map_or_else(|| "…".to_owned(), |s| format!("{s:.0} s"));
                self.bar.set_message(format!("t = {:.4}/{}  ETA {eta}", progress.time, progress.end_time));
            }
            Record::Checkpoint(checkpoint) => {
                self.checkpoints.push(checkpoint.clone());
                while self.checkpoints.len() > self.keep {
                    let old = self.checkpoints.remove(0);
                    std::fs::remove_file(self.out.join(old.path))?;
                }
            }
            Record::Warning { message, .. } => self.say(message)?,
            Record::Finding(finding) => self.say(&finding.to_string())?,
            Record::Started { .. } | Record::Phase { .. } | Record::File(_) | Record::Verdict(_) => {}
        }
        Ok(())
    }
}
