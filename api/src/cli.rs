//! The command line.

use crate::access::{self, ME, Scope};
use crate::config::{Choices, Config};
use crate::foreground;
use crate::serve::{self, Reloading};
use crate::telemetry;
use clap::{Parser, Subcommand};
use meniscus_jobs::inspection::{look, sandbox};
use meniscus_jobs::service::backup;
use meniscus_jobs::service::fsck;
use meniscus_jobs::spec::calibration::Measurements;
use meniscus_jobs::spec::records::Verdict;
use meniscus_jobs::spec::requests::NOT_STARTED_CODE;
use meniscus_jobs::spec::uploads::Purpose;
use meniscus_jobs::system::digest;
use meniscus_jobs::system::process;
use meniscus_jobs::verify;
use meniscus_jobs::worker;
use meniscus_jobs::worker::bundle::{self, Bundle};
use meniscus_jobs::worker::detached::Terms;
use std::fmt::Display;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, TryFromFloatSecsError};

#[derive(Debug, Parser)]
#[command(name = "meniscus", version, about = "Simulation service for moving interfaces and the physics on them")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run the HTTP service.
    Serve {
        /// Configuration file (TOML) with the names of the flags; flags override it.
        #[arg(long)]
        config: Option<PathBuf>,
        #[command(flatten)]
        choices: Choices,
    },
    /// Run one job, or the runs of a verification case one after another, in the foreground.
    Run {
        /// A job body, a scene or a verification case, as JSON.
        file: PathBuf,
        /// Directory for the results; must be new or empty.
        #[arg(long)]
        out: PathBuf,
        /// Threads; all cores by default.
        #[arg(long)]
        threads: Option<usize>,
    },
    /// Continue from a checkpoint to the end of its scene, in the foreground.
    Resume {
        /// A checkpoint file.
        checkpoint: PathBuf,
        /// Directory for the results; must be new or empty.
        #[arg(long)]
        out: PathBuf,
        /// Threads; all cores by default.
        #[arg(long)]
        threads: Option<usize>,
    },
    /// Run the verification cases and compare them with their targets; fails if a target is missed.
    Verify {
        /// Kinds of scenes, separated by commas; all by default.
        #[arg(long, value_delimiter = ',')]
        only: Vec<String>,
        /// Include long targets, and write documents and plots of the results.
        #[arg(long)]
        full: bool,
        /// Verify the checks of runs instead: bad runs must be refused, end or be doubtful, and no check may end a good one.
        #[arg(long)]
        checks: bool,
        /// Directory of cases, KIND/NAME.json; those of the program by default.
        #[arg(long)]
        cases: Option<PathBuf>,
        /// Directory of the runs; runs of the same build are not repeated.
        #[arg(long, default_value = "verify-output")]
        runs: PathBuf,
        /// Directory for documents and plots, with --full.
        #[arg(long, default_value = "docs/results")]
        results: PathBuf,
    },
    /// Make a consistent copy of a data directory, even while a service uses it.
    Backup {
        /// Directory for the copy; must be new or empty.
        target: PathBuf,
        /// Data directory.
        #[arg(long)]
        data: PathBuf,
    },
    /// Check a data directory that no service uses; fails if something is wrong.
    Fsck {
        /// Data directory.
        #[arg(long)]
        data: PathBuf,
    },
    /// Make a token and print it once, followed by its line for the token file.
    Token {
        /// Name of the client.
        name: String,
        /// Scopes of the token: read, submit, control, admin, separated by commas.
        #[arg(long, default_value = "read,submit,control")]
        scopes: String,
    },
    /// Examine an uploaded file (started by the service, in a sandbox).
    #[command(hide = true)]
    Inspect {
        /// What the file is used as.
        #[arg(long = "as")]
        purpose: String,
        /// The file.
        file: PathBuf,
    },
    /// Measure this machine (started by the service).
    #[command(hide = true)]
    Calibrate {
        /// Scratch directory; its content is deleted.
        #[arg(long)]
        scratch: PathBuf,
        /// Threads.
        #[arg(long, default_value_t = 1)]
        threads: u64,
    },
    /// Work through a list of short attempts (started by a cluster).
    #[command(hide = true)]
    Bundle {
        /// File with a directory a line.
        #[arg(long)]
        list: PathBuf,
        /// What claims the attempts.
        #[arg(long)]
        owner: String,
        /// Attempts at once.
        #[arg(long)]
        lanes: usize,
        /// Seconds between two signs of life of a worker.
        #[arg(long)]
        heartbeat_s: f64,
        /// Seconds without one after which a worker ends itself.
        #[arg(long)]
        lease_s: f64,
        /// Digest that the program must have.
        #[arg(long)]
        program_sha256: Option<String>,
    },
    /// Run one attempt of a job (started by the service).
    #[command(hide = true)]
    Worker {
        /// Directory of the attempt.
        #[arg(long)]
        attempt: PathBuf,
        /// Without a pipe to the service: requests and signs of life are files of the attempt.
        #[arg(long, requires = "heartbeat_s", requires = "lease_s")]
        detached: bool,
        /// Seconds between two signs of life of a detached worker.
        #[arg(long)]
        heartbeat_s: Option<f64>,
        /// Seconds without one after which a detached worker ends itself.
        #[arg(long)]
        lease_s: Option<f64>,
        /// Digest that the program must have.
        #[arg(long)]
        program_sha256: Option<String>,
    },
}

/// Most threads that wait for the disk. More threads would only use memory.
const BLOCKING_THREADS: usize = 16;

/// Parses the arguments and runs the command.
#[must_use]
pub fn main() -> ExitCode {
    match Arguments::parse().command {
        Command::Serve { config, choices } => run_service(config, choices),
        Command::Run { file, out, threads } => foreground::run(&file, &out, threads).unwrap_or_else(|e| fail(&e)),
        Command::Resume { checkpoint, out, threads } => {
            foreground::resume(&checkpoint, &out, threads).unwrap_or_else(|error| fail(&error))
        }
        Command::Verify { only, full, checks, cases, runs, results } => {
            let verified = verify_cases(&verify::Request { only, full, cases, runs, results }, checks);
            verified.unwrap_or_else(|error| fail(&error))
        }
        Command::Backup { target, data } => {
            backup::back_up(&data, &target).map_or_else(|e| fail(&e), |()| ExitCode::SUCCESS)
        }
        Command::Fsck { data } => check_data(&data).unwrap_or_else(|error| fail(&error)),
        Command::Token { name, scopes } => make_token(&name, &scopes),
        Command::Inspect { purpose, file } => inspect(&purpose, &file),
        Command::Calibrate { scratch, threads } => calibrate(&scratch, threads),
        Command::Bundle { list, owner, lanes, heartbeat_s, lease_s, program_sha256 } => {
            let done = match terms(heartbeat_s, lease_s, program_sha256) {
                Ok(terms) => work_through(&list, owner, lanes, terms),
                Err(error) => return fail(&error),
            };
            done.map_or_else(|error| fail(&error), |()| ExitCode::SUCCESS)
        }
        Command::Worker { attempt, detached, heartbeat_s, lease_s, program_sha256 } => {
            let ran = if detached {
                match terms(heartbeat_s.unwrap_or_default(), lease_s.unwrap_or_default(), program_sha256) {
                    Ok(terms) => worker::detached::run(&attempt, &terms),
                    Err(error) => return fail(&error),
                }
            } else {
                worker::process::run(&attempt)
            };
            worker_code(ran)
        }
    }
}

/// Runs the service until it is told to stop.
fn run_service(config: Option<PathBuf>, choices: Choices) -> ExitCode {
    telemetry::start();
    let reloading = Reloading { flags: choices.clone(), file: config.clone() };
    let choices = match config.map(|path| Choices::from_file(&path)).transpose() {
        Ok(file) => choices.or(file.unwrap_or_default()),
        Err(error) => return fail(&error),
    };
    let config = match Config::new(&choices) {
        Ok(config) => config,
        Err(error) => return fail(&error),
    };
    let runtime =
        match tokio::runtime::Builder::new_multi_thread().max_blocking_threads(BLOCKING_THREADS).enable_all().build() {
            Ok(runtime) => runtime,
            Err(error) => return fail(&error),
        };
    let served = runtime.block_on(serve::serve(config, reloading));
    // Handlers that still wait for a disk do not delay the end.
    runtime.shutdown_background();
    served.map_or_else(|error| fail(&error), |()| ExitCode::SUCCESS)
}

/// How a worker without a pipe lives.
fn terms(heartbeat_s: f64, lease_s: f64, program_sha256: Option<String>) -> Result<Terms, TryFromFloatSecsError> {
    let (heartbeat, lease) = (Duration::try_from_secs_f64(heartbeat_s)?, Duration::try_from_secs_f64(lease_s)?);
    Ok(Terms { heartbeat, lease, program_sha256 })
}

fn work_through(list: &Path, owner: String, lanes: usize, terms: Terms) -> std::io::Result<()> {
    let attempts = bundle::read_list(list)?;
    bundle::run(&Bundle { attempts, owner, lanes, terms })
}

/// The exit code of a worker.
fn worker_code(ran: std::io::Result<Verdict>) -> ExitCode {
    match ran {
        Ok(Verdict::Unstarted { cause }) => {
            fail(&cause);
            ExitCode::from(NOT_STARTED_CODE)
        }
        Ok(_) => ExitCode::SUCCESS,
        Err(error) if process::is_shortage(&error) => {
            fail(&error);
            ExitCode::from(NOT_STARTED_CODE)
        }
        Err(error) => fail(&error),
    }
}

fn verify_cases(request: &verify::Request, checks: bool) -> Result<ExitCode, verify::VerifyError> {
    let mut output = std::io::stdout();
    let is_met = if checks {
        verify::checks::run(request, |line| writeln!(output, "{line}"))?
    } else {
        verify::verify(request, |outcome| writeln!(output, "{outcome}"))?
    };
    Ok(if is_met { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn check_data(data: &Path) -> Result<ExitCode, fsck::FsckError> {
    let findings = fsck::check(data)?;
    let mut output = std::io::stdout().lock();
    for finding in &findings.wrong {
        writeln!(output, "{finding}")?;
    }
    for place in &findings.set_aside {
        writeln!(
            output,
            "{place}: it belongs to no job and no upload and was set aside; delete it when you do not need it"
        )?;
    }
    let fsck::Findings { jobs, files, wrong, .. } = findings;
    writeln!(output, "{jobs} jobs and {files} files checked, {} errors", wrong.len())?;
    Ok(if wrong.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn make_token(name: &str, scopes: &str) -> ExitCode {
    let is_name =
        !name.is_empty() && name != ME && name.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_.@".contains(&b));
    if !is_name || Scope::parse_list(scopes).is_none() {
        return fail(
            &"a name may have letters, digits and -_.@ only, and is not `me`; scopes are read, submit, control, admin, separated by commas",
        );
    }
    let secret = match access::secret() {
        Ok(secret) => secret,
        Err(error) => return fail(&error),
    };
    let token = format!("mns_{secret}");
    let line = format!("{name} {scopes} sha256:{}", digest::of_bytes(token.as_bytes()));
    let shown = writeln!(std::io::stdout(), "{token}\n{line}");
    shown.map_or_else(|error| fail(&error), |()| ExitCode::SUCCESS)
}

fn inspect(purpose: &str, file: &Path) -> ExitCode {
    let Some(purpose) = Purpose::from_word(purpose) else {
        let words = Purpose::ALL.map(Purpose::word).join(", ");
        return fail(&format!("unknown purpose; allowed are {words}"));
    };
    let seen = sandbox::enter().and_then(|()| look::run(purpose, file, &mut std::io::stdout().lock()));
    seen.map_or_else(|error| fail(&error), |()| ExitCode::SUCCESS)
}

fn calibrate(scratch: &Path, threads: u64) -> ExitCode {
    process::be_nice();
    if let Err(error) = worker::process::end_with_input() {
        return fail(&error);
    }
    // It is emptied in the end: only a new or empty directory will do.
    if std::fs::read_dir(scratch).is_ok_and(|mut entries| entries.next().is_some()) {
        return fail(&format!("{} is not empty", scratch.display()));
    }
    // Speeds are known long before errors are: each is a line of its own.
    let hand_over = |found: &Measurements| {
        let line = serde_json::to_string(found).map_err(|error| error.to_string())?;
        writeln!(std::io::stdout().lock(), "{line}").map_err(|error| error.to_string())
    };
    let failed = |error: &str| {
        fail(&error);
    };
    let measured = worker::calibration::measure_here(scratch, threads)
        .and_then(|phases| hand_over(&Measurements { phases, ..Measurements::default() }))
        .and_then(|()| worker::calibration::precision_here(scratch, threads, &failed))
        .and_then(|precision| hand_over(&Measurements { precision, ..Measurements::default() }));
    measured.map_or_else(|error| fail(&error), |()| ExitCode::SUCCESS)
}

fn fail(error: &dyn Display) -> ExitCode {
    // Standard error may be closed.
    let _ = writeln!(std::io::stderr(), "meniscus: {error}");
    ExitCode::FAILURE
}
