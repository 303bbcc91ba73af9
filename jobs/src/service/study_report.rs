//! Speed against error over the points of a study: one line for every setting of the axes other than the spacing, with
//! its fitted order.

use crate::formats::speed_error::{self, Lines, Point, fitted_order};
use crate::service::store::{PointRow, StudyRow};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// The axis over which orders are fitted.
const SPACING: &str = "/scene/spacing";
/// Lines in one picture at most; the legend has no room for more.
const MOST_LINES: usize = 18;

/// One run of a line.
struct Run {
    spacing: f64,
    cpu_s: f64,
    index: u64,
    error: f64,
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
pub fn compose(study: &StudyRow, points: &[PointRow]) -> Value {
    let quantities: Vec<Value> = measure(study, points)
        .into_iter()
        .map(|(name, lines)| {
            let (quantity, norm) = name.split_once('.').unwrap_or((&name, ""));
            let lines: Vec<Value> = lines
                .into_iter()
                .map(|(label, runs)| {
                    let over = |x: fn(&Run) -> f64| runs.iter().map(|run| (x(run), run.error)).collect::<Vec<_>>();
                    let rows: Vec<Value> = runs
                        .iter()
                        .map(|run| {
                            json!({"index": run.index, "spacing": run.spacing, "cpu_s": run.cpu_s, "error": run.error})
                        })
                        .collect();
                    json!({
                        "label": label,
                        "order": fitted_order(&over(|run| run.spacing)),
                        "order_over_time": fitted_order(&over(|run| run.cpu_s)),
                        "points": rows,
                    })
                })
                .collect();
            json!({"quantity": quantity, "norm": norm, "lines": lines})
        })
        .collect();
    let done = points.iter().filter(|point| point.errors.is_some()).count();
    json!({"study": study.id, "points": study.points, "with_results": done, "errors": quantities})
}

/// The picture of one quantity and norm (`QUANTITY.NORM`, or the first that there is); None where nothing was measured.
///
/// # Errors
/// A message when it cannot be drawn.
pub fn draw(study: &StudyRow, points: &[PointRow], wanted: Option<&str>) -> Result<Option<String>, String> {
    let mut measured = measure(study, points);
    // The distance is what most people ask about first.
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
            let order = fitted_order(&runs.iter().map(|run| (run.spacing, run.error)).collect::<Vec<_>>());
            let label = order.map_or_else(|| label.clone(), |order| format!("{label}: order {order:.2}"));
            let point = |run: &Run| Point { spacing: run.spacing, seconds: run.cpu_s, error: run.error };
            (label, runs.iter().map(point).collect())
        })
        .collect();
    let shown = if many > MOST_LINES { format!(" (the first {MOST_LINES} of {many} lines)") } else { String::new() };
    let title = format!("{}: error of {name}{shown}", study.name.as_deref().unwrap_or(&study.id));
    speed_error::draw(&title, "CPU seconds", &lines).map(Some)
}
