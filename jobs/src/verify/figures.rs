//! Pictures of the full table, from what runs have left.

use super::{Bench, measure};
use crate::formats::chart::{self, Chart};
use crate::formats::{csv, picture, speed_error, vtkhdf};
use crate::worker::local_run::Keep;
use crate::worker::observers::series;
use meniscus::scene::rows::{Figure, Plot, Quantity};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

impl Bench {
    /// Makes a picture, and the runs that it shows where they are not there yet.
    pub(super) fn draw(&self, figure: &Figure, path: &Path) -> Result<(), String> {
        let title = figure.title;
        let text = match &figure.plot {
            Plot::SpeedAgainstError { quantity, otherwise, phases, lines } => {
                let seconds =
                    if phases.is_empty() { "CPU seconds".to_owned() } else { format!("CPU seconds of {phases}") };
                speed_error::draw(title, &seconds, &self.speed_lines((*quantity, *otherwise), phases, lines)?)
            }
            Plot::History { column, is_log, lines, marks } => {
                let lines = each(lines, |scene| self.history(scene, column))?;
                let (is_log, marks) = (*is_log, marks.clone());
                let chart =
                    Chart { title, across: "t", up: column, is_log, is_joined: true, lines, marks, ..Chart::default() };
                chart::draw(&chart)
            }
            Plot::Profile { field, reach, lines } => {
                let lines = each(lines, |scene| self.profile(scene, field, *reach))?;
                chart::draw(&Chart { title, across: "φ", up: field, lines, ..Chart::default() })
            }
            Plot::Points { across, quantity, lines, expected } => {
                let lines = each(lines, |points| self.points(points, *quantity))?;
                let up = format!("{} {}", quantity.name, quantity.norm);
                let expected = expected.clone();
                chart::draw(&Chart { title, across, up: &up, lines, expected, ..Chart::default() })
            }
            Plot::Frames { scene, every_time, chosen } => return self.frames(scene, *every_time, chosen, path),
        }?;
        fs::write(path, text).map_err(|error| error.to_string())
    }

    fn speed_lines(
        &self,
        (quantity, otherwise): (Quantity, Option<Quantity>),
        phases: &str,
        lines: &[(String, Vec<Value>)],
    ) -> Result<speed_error::Lines, String> {
        let point = |scene: &Value| {
            let report = self.report(scene)?;
            let found = || {
                Some(speed_error::Point {
                    spacing: measure::spacing(scene)?,
                    seconds: measure::seconds(&report, phases),
                    error: measure::error(&report, quantity).or_else(|| measure::error(&report, otherwise?))?,
                })
            };
            found().ok_or_else(|| format!("{scene} reports no {} {}", quantity.name, quantity.norm))
        };
        each(lines, |runs| runs.iter().map(point).collect())
    }

    /// A column of the series of a run over time.
    fn history(&self, scene: &Value, column: &str) -> Result<Vec<(f64, f64)>, String> {
        let directory = self.ran(&json!({"scene": scene}), Keep::Report)?;
        let text = fs::read_to_string(directory.join(series::FILE_NAME)).map_err(|error| error.to_string())?;
        let rows = csv::to_json(&text)["rows"].take();
        let number = |row: &Value, name: &str| row[name].as_f64().unwrap_or(f64::NAN);
        Ok(rows.as_array().into_iter().flatten().map(|row| (number(row, "time"), number(row, column))).collect())
    }

    fn profile(&self, scene: &Value, field: &str, reach: f64) -> Result<Vec<(f64, f64)>, String> {
        let directory = self.ran(&json!({"scene": scene}), Keep::Frames)?;
        let last = frames_of(&directory)?.pop().ok_or("the run left no frame")?;
        let found = vtkhdf::read_profile(&last, field).map_err(|error| error.to_string())?;
        let all = found.ok_or_else(|| format!("frames have no phi or no {field}"))?;
        Ok(all.into_iter().filter(|(phi, _)| phi.abs() <= reach).collect())
    }

    fn points(&self, points: &[(f64, Value)], quantity: Quantity) -> Result<Vec<(f64, f64)>, String> {
        let point = |(across, scene): &(f64, Value)| {
            let value = measure::error(&self.report(scene)?, quantity).unwrap_or(f64::NAN);
            Ok((*across, value))
        };
        points.iter().map(point).collect()
    }

    fn frames(&self, scene: &Value, every_time: f64, chosen: &[usize], path: &Path) -> Result<(), String> {
        let body = json!({"scene": scene, "output": {"every_time": every_time}});
        let files = frames_of(&self.ran(&body, Keep::Frames)?)?;
        let mut views = Vec::new();
        for file in chosen.iter().filter_map(|k| files.get(*k)) {
            views.extend(vtkhdf::read_frame(file).map_err(|error| error.to_string())?);
        }
        picture::draw(path, &views, picture::spacing(scene, &views))
    }
}

/// Labels with what is found for each.
fn each<T, P>(lines: &[(String, T)], found: impl Fn(&T) -> Result<P, String>) -> Result<Vec<(String, P)>, String> {
    lines.iter().map(|(label, of)| Ok((label.clone(), found(of)?))).collect()
}

/// The frames of a run, in the order of time.
fn frames_of(directory: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = fs::read_dir(directory.join("frames")).map_err(|error| error.to_string())?;
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "vtkhdf"));
    files.sort();
    Ok(files)
}
