//! Draws the plots of the full results from the files of their runs.

use super::measure::{self, Quantity};
use super::plot::{Content, Plot, PointsLine, RunsLine};
use super::workspace::Workspace;
use crate::formats::chart::{self, Chart};
use crate::formats::{csv, frame_view, picture, speed_error, vtkhdf};
use crate::spec::attempt_files;
use crate::worker::local_run::Keep;
use meniscus::scene;
use meniscus::scenes::SCENES;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

impl Workspace {
    /// Draws a plot into a file, and makes the runs that it shows where they are not there yet.
    pub(super) fn draw(&self, plot: &Plot, path: &Path) -> Result<(), String> {
        let title = plot.title.as_str();
        let text = match &plot.plot {
            Content::SpeedAgainstError { error, fallback, spans, lines } => {
                let seconds =
                    if spans.is_empty() { "CPU seconds".to_owned() } else { format!("CPU seconds of {spans}") };
                speed_error::draw(title, &seconds, &self.speed_lines(error, fallback.as_ref(), spans, lines)?)
            }
            Content::History { column, is_logarithmic, lines, marks } => {
                let lines = lines
                    .iter()
                    .map(|line| Ok((line.label.clone(), self.history(&line.run, column)?)))
                    .collect::<Result<_, String>>()?;
                let (is_log, marks) = (*is_logarithmic, marks.clone());
                let chart =
                    Chart { title, across: "t", up: column, is_log, is_joined: true, lines, marks, ..Chart::default() };
                chart::draw(&chart)
            }
            Content::Profile { field, largest_distance, lines } => {
                let lines = lines
                    .iter()
                    .map(|line| Ok((line.label.clone(), self.profile(&line.run, field, *largest_distance)?)))
                    .collect::<Result<_, String>>()?;
                chart::draw(&Chart { title, across: "φ", up: field, lines, ..Chart::default() })
            }
            Content::Points { across, error, lines, expected } => {
                let lines = lines
                    .iter()
                    .map(|line| Ok((line.label.clone(), self.points(line, error)?)))
                    .collect::<Result<_, String>>()?;
                let up = format!("{} {}", error.quantity, error.norm);
                let expected = expected.clone();
                chart::draw(&Chart { title, across, up: &up, lines, expected, ..Chart::default() })
            }
            Content::Frames { run, every_time, frames } => return self.frames(run, *every_time, frames, path),
        }?;
        fs::write(path, text).map_err(|error| error.to_string())
    }

    fn speed_lines(
        &self,
        error: &Quantity,
        fallback: Option<&Quantity>,
        spans: &str,
        lines: &[RunsLine],
    ) -> Result<speed_error::Lines, String> {
        let point = |scene: &Value| {
            let run = self.finish(&json!({"scene": scene}))?;
            let found = || {
                Some(speed_error::Point {
                    spacing: run.spacing?,
                    seconds: measure::seconds(&run.report, spans),
                    error: measure::error(&run.report, error).or_else(|| measure::error(&run.report, fallback?))?,
                })
            };
            found().ok_or_else(|| format!("{scene} reports no {} {}", error.quantity, error.norm))
        };
        lines
            .iter()
            .map(|line| Ok((line.label.clone(), line.runs.iter().map(point).collect::<Result<_, String>>()?)))
            .collect()
    }

    /// A column of the series of a run over time.
    fn history(&self, scene: &Value, column: &str) -> Result<Vec<(f64, f64)>, String> {
        let directory = self.run(&json!({"scene": scene}), Keep::Report)?;
        let text = fs::read_to_string(directory.join(attempt_files::SERIES)).map_err(|error| error.to_string())?;
        let table = csv::Table::from_text(&text);
        Ok(table.column("time").zip(table.column(column)).collect())
    }

    /// A field of the last frame of a run over the signed distance.
    fn profile(&self, scene: &Value, field: &str, largest_distance: f64) -> Result<Vec<(f64, f64)>, String> {
        let directory = self.run(&json!({"scene": scene}), Keep::Frames)?;
        let last = frames_of(&directory)?.pop().ok_or("the run left no frame")?;
        let found = vtkhdf::read_profile(&last, field).map_err(|error| error.to_string())?;
        let all = found.ok_or_else(|| format!("frames have no phi or no {field}"))?;
        Ok(all.into_iter().filter(|(phi, _)| phi.abs() <= largest_distance).collect())
    }

    /// An error of each run over the number that stands for it.
    fn points(&self, line: &PointsLine, error: &Quantity) -> Result<Vec<(f64, f64)>, String> {
        let mut found = Vec::new();
        for point in &line.points {
            let run = self.finish(&json!({"scene": point.run}))?;
            found.push((point.at, measure::error(&run.report, error).unwrap_or(f64::NAN)));
        }
        Ok(found)
    }

    /// Draws frames of a run side by side.
    fn frames(&self, scene: &Value, every_time: f64, chosen: &[usize], path: &Path) -> Result<(), String> {
        let body = json!({"scene": scene, "output": {"every_time": every_time}});
        let files = frames_of(&self.run(&body, Keep::Frames)?)?;
        let parsed = scene::parse(scene, SCENES)
            .map_err(|found| found.first().map_or_else(String::new, |v| format!("{}: {}", v.pointer, v.detail)))?;
        let mut views = Vec::new();
        for file in chosen.iter().filter_map(|k| files.get(*k)) {
            views.extend(frame_view::read(file, parsed.view()).map_err(|error| error.to_string())?);
        }
        picture::draw(path, &views, picture::spacing(parsed.spacing(), &views))
    }
}

/// The frames of a run, in the order of time.
fn frames_of(directory: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = fs::read_dir(directory.join(attempt_files::FRAMES)).map_err(|error| error.to_string())?;
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "vtkhdf"));
    files.sort();
    Ok(files)
}
