//! The command line.

use crate::access::Scope;
use crate::application;
use crate::config::{Choices, Config};
use crate::foreground;
use crate::telemetry;
use base64::Engine;
use clap::{Parser, Subcommand};
use meniscus_jobs::inspection::{look, sandbox};
use meniscus_jobs::service::backup;
use meniscus_jobs::service::fsck;
use meniscus_jobs::spec::calibration;
use meniscus_jobs::spec::uploads::Purpose;
use meniscus_jobs::system::digest;
use meniscus_jobs::system::process;
use meniscus_jobs::verify;
use meniscus_jobs::worker;
use std::fmt::Display;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

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
        /// Configuration (TOML) with the names of the flags; flags win.
        #[arg(long)]
        config: Option<PathBuf>,
        #[command(flatten)]
        choices: Choices,
    },
    /// Run one job, or the runs of a verification case one after another, in the foreground.
    Run {
        /// A job body, a scene or a verification case, as JSON.
        file: PathBuf,
        /// Directory for the results, new or empty.
        #[arg(long)]
        out: PathBuf,
        /// Threads; all cores when not given.
        #[arg(long)]
        threads: Option<usize>,
    },
    /// Go on from a checkpoint to the end of its scene, in the foreground.
    Resume {
        /// A checkpoint file.
        checkpoint: PathBuf,
        /// Directory for the results, new or empty.
        #[arg(long)]
        out: PathBuf,
        /// Threads; all cores when not given.
        #[arg(long)]
        threads: Option<usize>,
    },
    /// Run the verification cases and compare their values with the targets; fails when one is missed.
    Verify {
        /// Kinds of scenes, with commas between; all when not given.
        #[arg(long, value_delimiter = ',')]
        only: Vec<String>,
        /// Long targets too, and documents and plots of the results.
        #[arg(long)]
        full: bool,
        /// Directory of cases, KIND/NAME.json; those of the program when not given.
        #[arg(long)]
        cases: Option<PathBuf>,
        /// Directory of the runs; those of the same build are not repeated.
        #[arg(long, default_value = "verify-output")]
        runs: PathBuf,
        /// Directory of the documents and plots of a full verification.
        #[arg(long, default_value = "docs/results")]
        results: PathBuf,
    },
    /// Make a consistent copy of a data directory, also of one in use.
    Backup {
        /// Directory for the copy, new or empty.
        target: PathBuf,
        /// Data directory.
        #[arg(long)]
        data: PathBuf,
    },
    /// Look over a data directory that no service is using; fails when something is wrong.
    Fsck {
        /// Data directory.
        #[arg(long)]
        data: PathBuf,
    },
    /// Make a token: shown once on standard output, its line for the token file behind it.
    Token {
        /// A name for its bearer.
        name: String,
        /// What it allows: read, submit, control, with commas between.
        #[arg(long, default_value = "read,submit,control")]
        scopes: String,
    },
    /// Look into a file from outside (started by the service, under limits).
    #[command(hide = true)]
    Inspect {
        /// What it is to be used as.
        #[arg(long = "as")]
        purpose: String,
        /// The file.
        file: PathBuf,
    },
    /// Measure this machine (started by the service).
    #[command(hide = true)]
    Calibrate {
        /// A directory to work in; it is emptied.
        #[arg(long)]
        scratch: PathBuf,
        /// Threads.
        #[arg(long, default_value_t = 1)]
        threads: u64,
    },
    /// Run one attempt at a job (started by the service).
    #[command(hide = true)]
    Worker {
        /// The attempt's directory.
        #[arg(long)]
        attempt: PathBuf,
    },
}

/// Threads that wait for the disk at most: more would only take memory.
const BLOCKING_THREADS: usize = 16;

/// Reads the arguments and does what they say.
#[must_use]
pub fn main() -> ExitCode {
    match Arguments::parse().command {
        Command::Serve { config, choices } => {
            telemetry::start();
            let choices = match config.map(|path| Choices::of_file(&path)).transpose() {
                Ok(file) => choices.or(file.unwrap_or_default()),
                Err(error) => return fail(&error),
            };
            let config = match Config::new(&choices) {
                Ok(config) => config,
                Err(error) => return fail(&error),
            };
            let runtime = match tokio::runtime::Builder::new_multi_thread()
                .max_blocking_threads(BLOCKING_THREADS)
                .enable_all()
                .build()
            {
                Ok(runtime) => runtime,
                Err(error) => return fail(&error),
            };
            let served = runtime.block_on(application::serve(config));
            // Handlers that still wait on a disk do not hold up the end.
            runtime.shutdown_background();
            served.map_or_else(|error| fail(&error), |()| ExitCode::SUCCESS)
        }
        Command::Run { file, out, threads } => foreground::run(&file, &out, threads).unwrap_or_else(|e| fail(&e)),
        Command::Resume { checkpoint, out, threads } => {
            foreground::resume(&checkpoint, &out, threads).unwrap_or_else(|error| fail(&error))
        }
        Command::Verify { only, full, cases, runs, results } => {
            let request = verify::Request { only, full, cases, runs, results };
            let show = |outcome: &verify::Outcome| writeln!(std::io::stdout(), "{outcome}");
            match verify::verify(&request, show) {
                Ok(true) => ExitCode::SUCCESS,
                Ok(false) => ExitCode::FAILURE,
                Err(error) => fail(&error),
            }
        }
        Command::Backup { target, data } => {
            backup::back_up(&data, &target).map_or_else(|e| fail(&e), |()| ExitCode::SUCCESS)
        }
        Command::Fsck { data } => look_over(&data).unwrap_or_else(|error| fail(&error)),
        Command::Token { name, scopes } => make_token(&name, &scopes),
        Command::Inspect { purpose, file } => inspect(&purpose, &file),
        Command::Calibrate { scratch, threads } => calibrate(&scratch, threads),
        Command::Worker { attempt } => worker::process::run(&attempt).map_or_else(|e| fail(&e), |_| ExitCode::SUCCESS),
    }
}

fn look_over(data: &Path) -> Result<ExitCode, fsck::FsckError> {
    let findings = fsck::check(data)?;
    let mut output = std::io::stdout().lock();
    for finding in &findings.wrong {
        writeln!(output, "{finding}")?;
    }
    let fsck::Findings { jobs, files, wrong } = findings;
    writeln!(output, "{jobs} jobs and {files} files looked at, {} things wrong", wrong.len())?;
    Ok(if wrong.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn make_token(name: &str, scopes: &str) -> ExitCode {
    let is_name = !name.is_empty() && name.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_.@".contains(&b));
    if !is_name || Scope::parse_list(scopes).is_none() {
        return fail(
            &"a name has letters, digits and -_.@ alone; scopes are read, submit, control with commas between",
        );
    }
    let mut secret = [0_u8; 32];
    let drawn = std::fs::File::open("/dev/urandom").and_then(|mut source| source.read_exact(&mut secret));
    if let Err(error) = drawn {
        return fail(&error);
    }
    let token = format!("mns_{}", base64::engine::general_purpose::URL_SAFE_NO_PAD.encode(secret));
    let line = format!("{name} {scopes} sha256:{}", digest::of_bytes(token.as_bytes()));
    let shown = writeln!(std::io::stdout(), "{token}\n{line}");
    shown.map_or_else(|error| fail(&error), |()| ExitCode::SUCCESS)
}

fn inspect(purpose: &str, file: &Path) -> ExitCode {
    let Some(purpose) = Purpose::from_word(purpose) else { return fail(&"there is no such purpose") };
    let seen = sandbox::enter().and_then(|()| look::run(purpose, file, &mut std::io::stdout().lock()));
    seen.map_or_else(|error| fail(&error), |()| ExitCode::SUCCESS)
}

fn calibrate(scratch: &Path, threads: u64) -> ExitCode {
    process::be_nice();
    if let Err(error) = worker::process::end_with_input() {
        return fail(&error);
    }
    let found = match calibration::measure_here(scratch, threads) {
        Ok(found) => found,
        Err(error) => return fail(&error),
    };
    let written = serde_json::to_writer(std::io::stdout().lock(), &found);
    written.map_or_else(|error| fail(&error), |()| ExitCode::SUCCESS)
}

fn fail(error: &dyn Display) -> ExitCode {
    // With standard error closed there is nobody to tell.
    let _ = writeln!(std::io::stderr(), "meniscus: {error}");
    ExitCode::FAILURE
}
