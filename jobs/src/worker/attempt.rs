//! One attempt at a job: build, restore, run under observers, finish, say how it ended.

use crate::formats::checkpoint::{CheckpointError, Counters};
use crate::formats::{frame_view, operator_files, picture};
use crate::spec::accuracy::ChosenAccuracy;
use crate::spec::attempt_files;
use crate::spec::attempt_spec::{AttemptSpec, StartCheckpoint};
use crate::spec::body::ResolvedBody;
use crate::spec::health::FindingLog;
use crate::spec::own_measures::check_fields;
use crate::spec::records::{FileRecord, Record, RecordSink, Verdict};
use crate::spec::run_options::RunOptions;
use crate::spec::states::Reason;
use crate::system::process;
use crate::system::{artifacts, digest};
use crate::worker::accuracy;
use crate::worker::inputs;
use crate::worker::log::Log;
use crate::worker::observers::checkpoints::Checkpoints;
use crate::worker::observers::frames::Frames;
use crate::worker::observers::progress::ProgressMeter;
use crate::worker::observers::series::Series;
use crate::worker::observers::{Control, Observers};
use crate::worker::report;
use crate::worker::start_checkpoint::{Refusal, load, open_when_there};
use meniscus::scene::{self, BuildContext, Scene};
use meniscus::scenes::SCENES;
use meniscus::simulation::run::{Ending, ObserverError};
use meniscus::simulation::{CpuClock, Measures, RunError, Simulation, StepError, run};
use serde::Deserialize;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Instant;

/// Runs one attempt to its verdict, which is also its last record. Panics become a verdict.
pub fn run_attempt(spec: &AttemptSpec, directory: &Path, control: &Control, sink: &mut dyn RecordSink) -> Verdict {
    let log = Log::new(directory);
    let outcome = catch_unwind(AssertUnwindSafe(|| attempt(spec, directory, control, sink, &log)));
    let verdict = match outcome {
        Ok(Ok(verdict)) => verdict,
        Ok(Err(failure)) => without_places(failure.verdict(directory), spec, directory),
        Err(_) => Verdict::Failed { reason: Reason::Internal, message: "the worker panicked".to_owned() },
    };
    log.line(&verdict.to_string());
    if let Verdict::Unstarted { .. } = verdict {
        // The exit code tells; the records begin with the next try.
        return verdict;
    }
    // Without a verdict the service treats the worker as lost, which is the truth then.
    let _ = sink.put(&Record::Verdict(verdict.clone()), true);
    verdict
}

/// A verdict whose message names no place of this machine: clients read it.
fn without_places(verdict: Verdict, spec: &AttemptSpec, directory: &Path) -> Verdict {
    match verdict {
        Verdict::Failed { reason, message } => Verdict::Failed { reason, message: hide(&message, spec, directory) },
        other => other,
    }
}

/// A text without the directories of the job.
fn hide(text: &str, spec: &AttemptSpec, directory: &Path) -> String {
    let attempts = spec.attempts_directory.display().to_string();
    let job = spec.attempts_directory.parent().map(|p| p.display().to_string()).filter(|p| p.len() > 1);
    let hidden = text.replace(&directory.display().to_string(), "…").replace(&attempts, "…");
    job.map_or_else(|| hidden.clone(), |job| hidden.replace(&job, "…"))
}

/// Whatever ends an attempt early.
enum Failure {
    Run(RunError),
    Other(ObserverError),
    Known(Reason, String),
    Canceled,
    /// The set-up was dropped on request.
    Paused(Option<Reason>),
    /// The system did not grant what it needs to begin.
    Unstarted(String),
}

impl<E: Into<ObserverError>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Other(error.into())
    }
}

impl Failure {
    /// Whether work was dropped on request.
    fn is_interruption(&self) -> bool {
        matches!(self, Self::Run(RunError::Step(StepError::Interrupted)))
    }

    fn verdict(self, directory: &Path) -> Verdict {
        match self {
            Self::Paused(reason) => Verdict::Paused { reason },
            Self::Unstarted(cause) => Verdict::Unstarted { cause },
            Self::Canceled | Self::Run(RunError::Step(StepError::Interrupted)) => Verdict::Canceled,
            Self::Known(reason, message) => Verdict::Failed { reason, message },
            Self::Run(RunError::Step(error)) => Verdict::Failed { reason: (&error).into(), message: error.to_string() },
            Self::Run(RunError::Observer(error)) | Self::Other(error) => storage_verdict(error.as_ref(), directory),
        }
    }
}

fn storage_verdict(error: &(dyn std::error::Error + 'static), directory: &Path) -> Verdict {
    if let Some(CheckpointError::NonFinite { .. }) = error.downcast_ref::<CheckpointError>() {
        return Verdict::Failed { reason: Reason::DivergedNonfinite, message: error.to_string() };
    }
    let full = process::is_out_of_space(error) || process::free_space(directory).is_some_and(|free| free < 1 << 20);
    if full {
        return Verdict::Paused { reason: Some(Reason::StorageEnospc) };
    }
    Verdict::Failed { reason: Reason::StorageIo, message: error.to_string() }
}

fn attempt(
    spec: &AttemptSpec,
    directory: &Path,
    control: &Control,
    sink: &mut dyn RecordSink,
    log: &Log,
) -> Result<Verdict, Failure> {
    let internal = |error: &dyn std::error::Error| Failure::Known(Reason::Internal, error.to_string());
    let ResolvedBody { scene, options, accuracy, .. } =
        ResolvedBody::deserialize(&spec.body).map_err(|error| internal(&error))?;
    let scene_sha256 = digest::of_bytes(scene.to_string().as_bytes());
    let scene = parsed(scene)?;
    let threads = options.threads();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool =
        pool.map_err(|e| if process::is_shortage(&e) { Failure::Unstarted(e.to_string()) } else { internal(&e) })?;
    log.line(&format!("attempt {} of {} on {} threads", spec.epoch, spec.job, threads));
    // Time that a lost attempt spent after its checkpoint was spent all the same: the service's count leads.
    let mut progress = ProgressMeter::new(spec.usage, spec.time.clone());
    pool.install(|| {
        sink.put(&Record::Phase { phase: "setting up".to_owned() }, false)?;
        let mut simulation = build(spec, scene.as_ref(), &options, control)?;
        let start = restore(spec, simulation.as_mut(), sink, log)?;
        progress.continue_phases(start.counters.phases.clone());
        let measures = measures(&options, scene.as_ref(), simulation.as_ref())?;
        let mut observers = prepare(spec, directory, (&options, measures), control, sink, &start, (progress, log))?;
        let step = simulation.clock().step;
        tell_start(&mut observers, &start, step)?;
        log.line(&format!("start at step {step}, {} particles", simulation.particle_count()));
        let ending = match run(simulation.as_mut(), &mut observers) {
            Err(RunError::Step(StepError::Interrupted)) if control.is_only_pausing() => {
                observers.rescue()?;
                return Ok(Verdict::Paused { reason: control.pause_reason() });
            }
            ran => ran.map_err(Failure::Run)?,
        };
        let word = if ending == Ending::Finished { "finished" } else { "stopped" };
        log.line(&format!("{word} at step {}", simulation.clock().step));
        match ending {
            Ending::Stopped if control.is_canceled() => Ok(Verdict::Canceled),
            Ending::Stopped => {
                let starved = observers.is_starved.then_some(Reason::StorageEnospc);
                Ok(Verdict::Paused { reason: starved.or_else(|| control.pause_reason()) })
            }
            Ending::Finished => {
                let operators = match write_operators(directory, &options, simulation.as_mut(), &mut observers) {
                    // The checkpoint of the end stands; they are made when the job goes on.
                    Err(failure) if failure.is_interruption() && control.is_only_pausing() => {
                        return Ok(Verdict::Paused { reason: control.pause_reason() });
                    }
                    written => written?,
                };
                let (simulation, scene) = (simulation.as_ref(), scene.as_ref());
                let ended = Ended { simulation, scene, scene_sha256, threads, operators, accuracy };
                finish(spec, directory, &ended, &mut observers, log)?;
                Ok(Verdict::Succeeded)
            }
        }
    })
}

/// The scene of a resolved body; a job that an earlier version resolved goes on to mean the same.
fn parsed(scene: serde_json::Value) -> Result<Box<dyn Scene>, Failure> {
    let scene = scene::of_earlier_version(scene, SCENES);
    scene::parse(&scene, SCENES).map_err(|violations| {
        Failure::Known(Reason::InputDamaged, violations.first().map_or_else(String::new, |v| v.detail.clone()))
    })
}

/// Records what an attempt goes on from.
fn tell_start(observers: &mut Observers, start: &Start, step: u64) -> Result<(), Failure> {
    observers.sink.put(
        &Record::Started {
            step,
            frames: start.counters.frames.len() as u64,
            from_checkpoint: start.is_own,
            pid: std::process::id(),
        },
        true,
    )?;
    if !start.is_own {
        for finding in &start.counters.findings {
            observers.sink.put(&Record::Finding(finding.clone()), false)?;
        }
    }
    Ok(())
}

/// The simulation at the start of its scene, with the points that it takes from files.
fn build(
    spec: &AttemptSpec,
    scene: &dyn Scene,
    options: &RunOptions,
    control: &Control,
) -> Result<Box<dyn Simulation>, Failure> {
    let clouds = inputs::read(scene, spec).map_err(|cause| Failure::Known(Reason::InputDamaged, cause))?;
    let context = BuildContext {
        clouds,
        plan: options.plan(),
        interrupt: control.interrupt().clone(),
        cpu_clock: CpuClock(process::cpu_seconds),
    };
    let built = scene.build(context);
    // A build that was dropped on request says nothing about the input.
    if control.is_canceled() {
        return Err(Failure::Canceled);
    }
    if control.interrupt().is_raised() {
        return Err(Failure::Paused(control.pause_reason()));
    }
    built.map_err(|found| {
        let cause = found.first().map_or_else(String::new, |v| format!("{}: {}", v.pointer, v.detail));
        Failure::Known(Reason::InputDamaged, cause)
    })
}

/// The probes and measures of a run.
fn measures(options: &RunOptions, scene: &dyn Scene, simulation: &dyn Simulation) -> Result<Measures, Failure> {
    let refuse = |cause: String| Failure::Known(Reason::InputDamaged, cause);
    let planned = options.output.own_measures().plan(scene).map_err(|found| {
        let cause = found.first().map_or_else(String::new, |v| format!("{}: {}", v.pointer, v.detail));
        refuse(cause)
    })?;
    match check_fields(&planned, simulation) {
        Some(cause) => Err(refuse(cause)),
        None => Ok(planned),
    }
}

/// What an attempt goes on from.
#[derive(Default)]
struct Start {
    counters: Counters,
    /// Whether the checkpoint was this job's own, so that the output of its step exists.
    is_own: bool,
    step: u64,
}

/// Restores the newest sound checkpoint of the spec; damaged ones are reported and passed over.
fn restore(
    spec: &AttemptSpec,
    simulation: &mut dyn Simulation,
    sink: &mut dyn RecordSink,
    log: &Log,
) -> Result<Start, Failure> {
    let began = Instant::now();
    for candidate in &spec.checkpoints {
        match open_when_there(spec, candidate, began) {
            Ok((meta, state)) => match load(simulation, &meta, state) {
                Ok(()) => {
                    log.line(&format!("restored {} at step {}", candidate.id, meta.step));
                    let mut counters = meta.counters;
                    if !candidate.is_own {
                        // Frame numbers go on; files, series and costs are those of another job.
                        let before = counters.frames_before + counters.frames.len() as u64;
                        // What was noticed there holds for what is built on it.
                        let findings = counters.findings;
                        counters = Counters { frames_before: before, findings, ..Counters::default() };
                    }
                    return Ok(Start { counters, is_own: candidate.is_own, step: meta.step });
                }
                Err(error) => refuse(spec, candidate, &error.to_string(), sink, log)?,
            },
            Err(Refusal::Incompatible(message)) if !candidate.is_own => {
                return Err(Failure::Known(Reason::CheckpointIncompatible, message));
            }
            Err(Refusal::Incompatible(message) | Refusal::Damaged(message)) => {
                refuse(spec, candidate, &message, sink, log)?;
            }
        }
    }
    if spec.may_start_afresh {
        return Ok(Start::default());
    }
    Err(Failure::Known(Reason::CheckpointNoneValid, format!("{} checkpoints were tried", spec.checkpoints.len())))
}

fn refuse(
    spec: &AttemptSpec,
    candidate: &StartCheckpoint,
    message: &str,
    sink: &mut dyn RecordSink,
    log: &Log,
) -> Result<(), Failure> {
    let message = format!("checkpoint {} is passed over: {message}", candidate.id);
    let message = hide(&message, spec, &spec.attempts_directory);
    log.line(&message);
    sink.put(&Record::Warning { code: "checkpoint.refused".to_owned(), message }, true)?;
    Ok(())
}

fn prepare<'a>(
    spec: &AttemptSpec,
    directory: &Path,
    (options, measures): (&RunOptions, Measures),
    control: &'a Control,
    sink: &'a mut dyn RecordSink,
    start: &Start,
    (progress, log): (ProgressMeter, &'a Log),
) -> Result<Observers<'a>, Failure> {
    let plan = options.plan();
    let counters = &start.counters;
    let earlier = start.is_own.then(|| {
        (
            spec.attempts_directory.join(counters.series_epoch.to_string()).join(attempt_files::SERIES),
            counters.series_bytes,
        )
    });
    Ok(Observers {
        frames: Frames::new(
            directory.to_owned(),
            spec.epoch,
            plan,
            options.output.fields.clone(),
            counters.frames.clone(),
            counters.frames_before,
        ),
        series: Series::open(directory, spec.epoch, plan, measures, earlier)?,
        checkpoints: Checkpoints::new(
            directory.to_owned(),
            spec.job.clone(),
            spec.body.clone(),
            options.checkpoint.every_wall_s,
            options.checkpoint.every_steps,
        ),
        progress,
        findings: FindingLog::new(counters.findings.clone()),
        log,
        control,
        sink,
        directory: directory.to_owned(),
        reserve_bytes: spec.reserve_bytes,
        is_starved: false,
        restored: (start.is_own && !counters.is_before_output).then_some(start.step),
        kept: None,
    })
}

/// A run that has come to its end.
struct Ended<'a> {
    simulation: &'a dyn Simulation,
    scene: &'a dyn Scene,
    scene_sha256: String,
    threads: usize,
    /// Files of operators.
    operators: Vec<FileRecord>,
    /// The accuracy that was asked for.
    accuracy: Option<ChosenAccuracy>,
}

/// The files of operators that were asked for.
fn write_operators(
    directory: &Path,
    options: &RunOptions,
    simulation: &mut dyn Simulation,
    observers: &mut Observers,
) -> Result<Vec<FileRecord>, Failure> {
    let Some(format) = options.output.operators else { return Ok(Vec::new()) };
    let interrupt = observers.control.interrupt();
    let mut files = Vec::new();
    for operator in simulation.operators().map_err(|error| Failure::Run(error.into()))? {
        let files_of = operator_files::write(directory, &operator, format, interrupt);
        // A file that was dropped on request is no failure of the disk.
        let files_of = files_of.map_err(|error| {
            if interrupt.is_raised() { Failure::Run(RunError::Step(StepError::Interrupted)) } else { error.into() }
        })?;
        for (name, media_type) in files_of {
            let file = FileRecord::from_file(directory, &name, media_type)?;
            observers.sink.put(&Record::File(file.clone()), false)?;
            files.push(file);
        }
    }
    Ok(files)
}

/// Report, picture and digests of a finished run.
fn finish(
    spec: &AttemptSpec,
    directory: &Path,
    ended: &Ended,
    observers: &mut Observers,
    log: &Log,
) -> Result<(), Failure> {
    let simulation = ended.simulation;
    let mut files: Vec<_> = observers.frames.written().iter().map(|(_, file)| file.clone()).collect();
    files.extend_from_slice(&ended.operators);
    // The frames may be an earlier attempt's; the index of all is this one's in any case.
    files.push(observers.frames.write_index()?);
    observers.sink.put(&Record::File(files[files.len() - 1].clone()), false)?;
    observers.series.sync()?;
    let series = FileRecord::from_file(directory, attempt_files::SERIES, "text/csv")?;
    files.push(series.clone());
    observers.sink.put(&Record::File(series), false)?;
    if let Some(drawn) = draw_picture(spec, directory, ended.scene, observers, log) {
        files.push(drawn.clone());
        observers.sink.put(&Record::File(drawn), false)?;
    }
    let phases = observers.progress.phases(simulation);
    let usage = observers.progress.usage();
    let compose = |findings: &FindingLog| {
        report::compose(simulation, findings, &usage, phases.clone(), ended.threads, &ended.scene_sha256)
    };
    let report = match &ended.accuracy {
        Some(chosen) => accuracy::report(chosen, directory, ended.scene, observers, compose)?,
        None => compose(&observers.findings),
    };
    artifacts::write(&directory.join(attempt_files::REPORT), &serde_json::to_vec_pretty(&report)?)?;
    let report = FileRecord::from_file(directory, attempt_files::REPORT, "application/json")?;
    files.push(report.clone());
    observers.sink.put(&Record::File(report), false)?;
    files.sort_by(|a, b| a.path.cmp(&b.path));
    let sums: String = files.iter().map(|file| format!("{}  {}\n", file.sha256, file.path)).collect();
    artifacts::write(&directory.join(attempt_files::DIGESTS), sums.as_bytes())?;
    let sums = FileRecord::from_file(directory, attempt_files::DIGESTS, "text/plain")?;
    observers.sink.put(&Record::File(sums), true)?;
    Ok(())
}

/// The first, the middle and the last frame side by side; a picture that fails is logged and left out.
fn draw_picture(
    spec: &AttemptSpec,
    directory: &Path,
    scene: &dyn Scene,
    observers: &Observers,
    log: &Log,
) -> Option<FileRecord> {
    let frames = observers.frames.written();
    let mut chosen = vec![0, frames.len() / 2, frames.len().saturating_sub(1)];
    chosen.dedup();
    let place = |epoch: u64| {
        if epoch == spec.epoch { directory.to_owned() } else { spec.attempts_directory.join(epoch.to_string()) }
    };
    let mut views = Vec::new();
    for (epoch, file) in chosen.iter().filter_map(|k| frames.get(*k)) {
        match frame_view::read(&place(*epoch).join(&file.path), scene.view()) {
            Ok(Some(frame)) => views.push(frame),
            Ok(None) => return None,
            Err(error) => {
                log.line(&hide(&format!("no picture: {error}"), spec, directory));
                return None;
            }
        }
    }
    let spacing = picture::spacing(scene.spacing(), &views);
    let path = directory.join(attempt_files::PICTURE);
    let drawn = picture::draw(&artifacts::unfinished(&path), &views, spacing)
        .and_then(|()| artifacts::finish(&path).map_err(|e| e.to_string()))
        .and_then(|()| {
            FileRecord::from_file(directory, attempt_files::PICTURE, "image/svg+xml").map_err(|e| e.to_string())
        });
    drawn.map_err(|error| log.line(&hide(&format!("no picture: {error}"), spec, directory))).ok()
}
