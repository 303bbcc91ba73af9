//! The command line.

use crate::application;
use crate::config::Config;
use crate::foreground;
use crate::telemetry;
use clap::{Parser, Subcommand};
use meniscus_jobs::executor::worker_process;
use meniscus_jobs::{backup, verify};
use std::fmt::Display;
use std::io::Write;
use std::net::SocketAddr;
use std::path::PathBuf;
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
        /// Data directory; made when it is not there.
        #[arg(long)]
        data: PathBuf,
        /// Address to listen on; port 0 picks a free one.
        #[arg(long, default_value = "127.0.0.1:8080")]
        bind: SocketAddr,
        /// Jobs at once; cores / threads when not given.
        #[arg(long, value_parser = clap::value_parser!(u64).range(1..=1024))]
        slots: Option<u64>,
        /// Threads of a job, default and most; cores / slots, or 1, when not given.
        #[arg(long, value_parser = clap::value_parser!(u64).range(1..=1024))]
        threads: Option<u64>,
    },
    /// Run one job in the foreground.
    Run {
        /// A job body or a scene, as JSON.
        scene: PathBuf,
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
    /// Run what scenes must show and compare the figures; fails when one is missed.
    Verify {
        /// Kinds of scenes, with commas between; all when not given.
        #[arg(long, value_delimiter = ',')]
        only: Vec<String>,
        /// Long rows too, and tables and pictures of the results.
        #[arg(long)]
        full: bool,
        /// Directory of the runs; those of the same build are not repeated.
        #[arg(long, default_value = "verify-output")]
        runs: PathBuf,
        /// Directory of the results of a full table.
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
    /// Run one attempt at a job (started by the service).
    #[command(hide = true)]
    Worker {
        /// The attempt's directory.
        #[arg(long)]
        attempt: PathBuf,
    },
}

/// Reads the arguments and does what they say.
#[must_use]
pub fn main() -> ExitCode {
    match Arguments::parse().command {
        Command::Serve { data, bind, slots, threads } => {
            telemetry::start();
            let small = |number: Option<u64>| number.map(|n| n as usize);
            let config = match Config::new(data, bind, small(slots), small(threads)) {
                Ok(config) => config,
                Err(error) => return fail(&error),
            };
            let runtime = match tokio::runtime::Builder::new_multi_thread().enable_all().build() {
                Ok(runtime) => runtime,
                Err(error) => return fail(&error),
            };
            let served = runtime.block_on(application::serve(config));
            // Handlers that still wait on a disk do not hold up the end.
            runtime.shutdown_background();
            served.map_or_else(|error| fail(&error), |()| ExitCode::SUCCESS)
        }
        Command::Run { scene, out, threads } => foreground::run(&scene, &out, threads).unwrap_or_else(|e| fail(&e)),
        Command::Resume { checkpoint, out, threads } => {
            foreground::resume(&checkpoint, &out, threads).unwrap_or_else(|error| fail(&error))
        }
        Command::Verify { only, full, runs, results } => {
            let request = verify::Request { only, full, runs, results };
            let shown = |outcome: &verify::Outcome| writeln!(std::io::stdout(), "{outcome}");
            match verify::verify(&request, shown) {
                Ok(true) => ExitCode::SUCCESS,
                Ok(false) => ExitCode::FAILURE,
                Err(error) => fail(&error),
            }
        }
        Command::Backup { target, data } => {
            backup::back_up(&data, &target).map_or_else(|e| fail(&e), |()| ExitCode::SUCCESS)
        }
        Command::Worker { attempt } => worker_process::run(&attempt).map_or_else(|e| fail(&e), |_| ExitCode::SUCCESS),
    }
}

fn fail(error: &dyn Display) -> ExitCode {
    // With standard error closed there is nobody to tell.
    let _ = writeln!(std::io::stderr(), "meniscus: {error}");
    ExitCode::FAILURE
}
