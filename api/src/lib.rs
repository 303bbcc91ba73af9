//! The HTTP job API and the command line of Meniscus.
//!
//! It computes nothing and stores nothing: it translates between HTTP and `meniscus_jobs`.

pub mod accept;
pub mod access;
pub mod archive;
pub mod base_path;
pub mod calibration;
pub mod cli;
pub mod config;
pub mod connections;
pub mod creation;
pub mod error;
pub mod file_response;
pub mod foreground;
pub mod idempotency;
pub mod layers;
pub mod openapi;
pub mod page;
pub mod pagination;
pub mod path;
pub mod problems;
pub mod query;
pub mod rate_limit;
pub mod request_body;
pub mod resource;
pub mod response_cache;
pub mod router;
pub mod routes;
pub mod serve;
pub mod signals;
pub mod state;
pub mod store_sources;
pub mod telemetry;
pub mod views;
