//! The process of one attempt: restores, runs under observers, writes checkpoints and output, reports.

pub mod accuracy;
pub mod attempt;
pub mod bundle;
pub mod calibration;
pub mod detached;
pub mod inputs;
pub mod local_run;
pub mod log;
pub mod observers;
pub mod process;
pub mod report;
mod start_checkpoint;
