//! Plain data that the service and its workers exchange. Nothing here opens the store or steps a simulation.

pub mod accuracy;
pub mod action;
pub mod attempt_files;
pub mod attempt_spec;
pub mod body;
pub mod calibration;
pub mod forecast;
pub mod health;
pub mod heartbeat;
mod json_numbers;
pub mod quantity;
pub mod records;
pub mod report;
pub mod requests;
pub mod own_measures;
pub mod run_options;
pub mod states;
pub mod strict_json;
pub mod study;
pub mod uploads;
pub mod work_precision;
