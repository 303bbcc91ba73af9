//! Durable jobs for the Meniscus engine.
//!
//! Two processes share this crate and meet in files only:
//!
//! - the service: [`body`] → [`store`] (the one SQLite file) → [`supervisor`] (queue, limits, recovery) → [`executor`];
//! - a worker: [`order`] → [`worker`] → [`observers`] → frames, checkpoints, series and [`records`] in its attempt's
//!   directory.
//!
//! The service reads the records, checks their epoch and publishes. It knows no HTTP and no numerics: a simulation is
//! a `dyn Simulation` to it.

pub mod artifacts;
pub mod backup;
pub mod body;
pub mod breakpoints;
pub mod build;
pub mod calibration;
pub mod checkpoint;
pub mod clock;
pub mod digest;
pub mod executor;
pub mod forecast;
pub mod formats;
pub mod fsck;
pub mod inputs;
pub mod job;
pub mod local_run;
pub mod lock;
pub mod observers;
pub mod order;
pub mod process;
pub mod records;
pub mod report;
pub mod store;
pub mod strict_json;
pub mod study;
pub mod supervisor;
pub mod uploads;
pub mod verify;
pub mod worker;
