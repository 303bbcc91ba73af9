//! Speed against error over the points of a study: one line for every setting of the axes other than the spacing, with
//! its fitted order.

use crate::formats::speed_error::{self, Lines, Point, fitted_order};
use crate::service::store::{PointRow, StudyRow};
use serde::Serialize;
use std::collections::BTreeMap;

/// The axis over which orders are fitted.
const SPACING: &str = "/scene/spacing";
/// Lines in one picture at most; the legend has no room for more.
const MOST_LINES: usize = 18;

/// The report of a study: errors beside costs, as clients see it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StudyReport {
    /// Id of the study.
    pub study: String,
    /// Number of points.
    pub points: u64,
    /// Number of points that have results.
    pub with_results: usize,
    /// Errors by quantity and norm.
    pub errors: Vec<QuantityErrors>,
}

/// Errors of a quantity in a norm.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct QuantityErrors {
    /// Quantity.
    pub quantity: String,
    /// Norm.
    pub norm: String,
    /// One line for every setting of the axes other than the spacing.
    pub lines: Vec<Line>,
}

/// Runs that differ in their spacing alone.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Line {
    /// Values of the other axes.
    pub label: String,
    /// Fitted order p of errors ~ h^p; None for fewer than two spacings.
    pub order: Option<f64>,
    /// The same over CPU time.
    pub order_over_time: Option<f64>,
    /// Runs, the coarsest first.
    pub points: Vec<Run>,
}

/// One run of a line.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Run {
    /// Number of the point in the study.
    pub index: u64,
    /// Spacing h; NaN where the scene has none.
    pub spacing: f64,
    /// CPU seconds.
    pub cpu_s: f64,
    /// Error at its latest time.
    pub error: f64,
}

impl Line {
    fn new(label: String, points: Vec<Run>) -> Self {
        let order =
            |x: fn(&Run) -> f64| fitted_order(&points.iter().map(|run| (x(run), run.error)).collect::<Vec<_>>());
        Self { label, order: order(|run| run.spacing), order_over_time: order(|run| run.cpu_s), points }
    }
}

/// What was measured of a quantity in a norm, by line.
type Measured = BTreeMap<String, BTreeMap<String, Vec<Run>>>;

fn measure(study: &StudyRow, points: &[PointRow]) -> Measured {
    let mut measured = Measured::new();
    for point in points {
        let others: Vec<String> = study
            .axes
            .iter()
            .zip(&point.values)
            .filter(|(axis, _)| *axis != SPACING)
            .map(|(axis, value)| format!("{axis} = {value}"))
            .collect();
        let label = if others.is_empty() { "all points".to_owned() } else { others.join(", ") };
        let spacing = point.spacing.unwrap_or(f64::NAN);
        for (name, value) in point.errors.iter().flatten() {
            if value.is_finite() {
                let run = Run { spacing, cpu_s: point.spent[0], index: point.index, error: *value };
                measured.entry(name.clone()).or_default().entry(label.clone()).or_default().push(run);
            }
        }
    }
    for lines in measured.values_mut() {
        for runs in lines.values_mut() {
            runs.sort_by(|a, b| b.spacing.total_cmp(&a.spacing).then(a.index.cmp(&b.index)));
        }
    }
    measured
}

/// Errors beside costs, with orders over the spacing and over CPU time.
#[must_use]
pub fn compose(study: &StudyRow, points: &[PointRow]) -> StudyReport {
    let errors = measure(study, points).into_iter().map(|(name, lines)| {
        let (quantity, norm) = name.split_once('.').unwrap_or((&name, ""));
        let lines = lines.into_iter().map(|(label, runs)| Line::new(label, runs));
        QuantityErrors { quantity: quantity.to_owned(), norm: norm.to_owned(), lines: lines.collect() }
    });
    StudyReport {
        study: study.id.clone(),
        points: study.points,
        with_results: points.iter().filter(|point| point.errors.is_some()).count(),
        errors: errors.collect(),
    }
}

/// The picture of one quantity and norm (`QUANTITY.NORM`, or the first that there is); None where nothing was measured.
///
/// # Errors
/// A message when it cannot be drawn.
pub fn draw(study: &StudyRow, points: &[PointRow], wanted: Option<&str>) -> Result<Option<String>, String> {
    let mut measured = measure(study, points);
    // The distance is asked for most often.
    let preferred = ["phi.rms", "phi.max"].into_iter().find(|name| measured.contains_key(*name));
    let Some(name) = wanted.or(preferred).map(str::to_owned).or_else(|| measured.keys().next().cloned()) else {
        return Ok(None);
    };
    let Some(lines) = measured.remove(&name) else { return Ok(None) };
    let many = lines.len();
    let lines: Lines = lines
        .into_iter()
        .take(MOST_LINES)
        .map(|(label, runs)| {
            let Line { label, order, points, .. } = Line::new(label, runs);
            let label = order.map_or_else(|| label.clone(), |order| format!("{label}: order {order:.2}"));
            let point = |run: &Run| Point { spacing: run.spacing, seconds: run.cpu_s, error: run.error };
            (label, points.iter().map(point).collect())
        })
        .collect();
    let shown = if many > MOST_LINES { format!(" (the first {MOST_LINES} of {many} lines)") } else { String::new() };
    let title = format!("{}: error of {name}{shown}", study.name.as_deref().unwrap_or(&study.id));
    speed_error::draw(&title, "CPU seconds", &lines).map(Some)
}
