//! The HTTP job API and the command line of Meniscus.
//!
//! It computes nothing and stores nothing: it translates between HTTP and `meniscus_jobs`.

pub mod access;
pub mod application;
pub mod calibration;
pub mod cli;
pub mod config;
pub mod creation;
pub mod error;
pub mod file_response;
pub mod foreground;
pub mod router;
pub mod routes;
pub mod shown;
pub mod telemetry;
pub mod views;
