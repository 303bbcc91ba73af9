//! Points of studies: what tables and reports need of their jobs.

use super::rows;
use crate::spec::forecast::ForecastRecord;
use crate::spec::health::HealthStatus;
use crate::spec::records::{Progress, Usage};
use crate::spec::report::Results;
use crate::spec::states::State;
use rusqlite::Row;
use serde_json::Value;
use std::collections::BTreeMap;

/// A point of a study with its latest job: what tables and reports need, and no more, of ten thousand.
#[derive(Debug, Clone, PartialEq)]
pub struct PointRow {
    /// Number of the point.
    pub index: u64,
    /// Number of the level within its set-up, in a study that refines.
    pub level: Option<u64>,
    /// Id of the latest job.
    pub job: String,
    /// State of that job.
    pub state: State,
    /// Reason of that state, if it has one.
    pub reason: Option<String>,
    /// Its value at every axis: as it was sent, else the default that it got.
    pub values: Vec<Value>,
    /// Spacing of its scene.
    pub spacing: Option<f64>,
    /// CPU seconds and seconds by the clock.
    pub spent: [f64; 2],
    /// Particles as reached, else as estimated.
    pub particles: u64,
    /// Steps done so far.
    pub steps: u64,
    /// Whether its results can be trusted; none before the first look.
    pub health: Option<HealthStatus>,
    /// Errors by `QUANTITY.NORM`, each at its latest time; None before the end.
    pub errors: Option<BTreeMap<String, f64>>,
}

pub(super) fn point_of(row: &Row, axes: &[String]) -> rusqlite::Result<PointRow> {
    let state: String = row.get("state")?;
    let forecast: ForecastRecord = rows::json(row, "estimate")?;
    let progress: Progress = rows::json(row, "progress")?;
    let usage: Usage = rows::json(row, "usage")?;
    let (spec, resolved): (Value, Value) = (rows::json(row, "spec")?, rows::json(row, "resolved")?);
    let value_at = |axis: &str| {
        // Axes are JSON pointers of the client's.
        let sent = Value::pointer(&spec, axis).filter(|value| !value.is_null());
        sent.or_else(|| Value::pointer(&resolved, axis)).cloned().unwrap_or(Value::Null)
    };
    let results: Option<Results> = rows::json(row, "results")?;
    Ok(PointRow {
        index: row.get::<_, i64>("study_index")? as u64,
        level: None,
        job: row.get("id")?,
        state: State::from_word(&state).ok_or(rusqlite::Error::InvalidQuery)?,
        reason: row.get("reason")?,
        values: axes.iter().map(|axis| value_at(axis)).collect(),
        spacing: value_at("/scene/spacing").as_f64(),
        spent: [usage.cpu_s, usage.wall_s],
        particles: if progress.particles > 0 { progress.particles } else { forecast.particles },
        steps: progress.step,
        health: row.get::<_, Option<String>>("health")?.as_deref().and_then(HealthStatus::from_word),
        errors: results.map(errors_of),
    })
}

/// Errors come in the order of their times: the latest stays.
fn errors_of(results: Results) -> BTreeMap<String, f64> {
    results.errors.into_iter().map(|error| (format!("{}.{}", error.quantity, error.norm), error.value)).collect()
}
