//! Durable jobs for the Meniscus engine, by process.
//!
//! The modules stand in order: each uses only those above it.
//!
//! - [`system`]: files, digests, the clock, what the operating system says of processes;
//! - [`convergence`]: what levels of refinement say of their limit, as plain numbers;
//! - [`spec`]: plain data that the service and its workers exchange: bodies, states, records, the attempt's specification;
//! - [`refinement`]: what studies that refine do next, and which spacing their levels tell;
//! - [`formats`]: files that other programs read, and checkpoints;
//! - [`worker`]: the process of one attempt;
//! - [`inspection`]: the process that looks into one uploaded file, under limits;
//! - [`service`]: the store (one SQLite file), the supervisor (queue, limits, recovery), the executor, uploads, studies;
//! - [`verify`]: runs cases with the worker's code and measures them.
//!
//! The service and its workers meet in files only. The service reads the records, checks their epoch and publishes. It
//! knows no HTTP and no numerics: a simulation is a `dyn Simulation` to it.

pub mod system;

pub mod convergence;

pub mod spec;

pub mod refinement;

pub mod formats;

pub mod worker;

pub mod inspection;

pub mod service;

pub mod verify;
