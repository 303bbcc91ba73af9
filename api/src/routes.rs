//! Handlers, one file a resource.

pub mod checkpoints;
pub mod estimates;
pub mod events;
pub mod files;
pub mod job_changes;
pub mod jobs;
pub mod metrics;
pub mod problems;
pub mod results;
pub mod scenes;
pub mod service;
pub mod studies;
pub mod tickets;
pub mod uploads;
