//! Error over spacing and over CPU time, log-log, one line a method (SVG).

use super::chart::{self, style};
use plotters::coord::Shift;
use plotters::prelude::{
    ChartBuilder, Circle, DrawingArea, IntoDrawingArea, IntoLogRange, PathElement, SVGBackend, ShapeStyle, WHITE,
};
use plotters::style::{BLACK, Color};
use std::ops::Range;

/// One run of a line.
#[derive(Debug, Clone, Copy)]
pub struct Point {
    /// Spacing h of the run.
    pub spacing: f64,
    /// CPU seconds of the run.
    pub seconds: f64,
    /// Error of the run.
    pub error: f64,
}

/// Labels and runs.
pub type Lines = Vec<(String, Vec<Point>)>;

/// A thin line of an order through the finest run of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slope {
    /// Number of the line.
    pub line: usize,
    /// The order p of errors ~ h^p.
    pub order: f64,
}

/// Both pictures side by side, as SVG; `seconds` names what was timed.
///
/// # Errors
/// A message when it cannot be drawn.
pub fn draw(title: &str, seconds: &str, lines: &[(String, Vec<Point>)]) -> Result<String, String> {
    draw_with_slope(title, seconds, lines, None)
}

/// The same with a slope over the spacing.
///
/// # Errors
/// A message when it cannot be drawn.
pub fn draw_with_slope(
    title: &str,
    seconds: &str,
    lines: &[(String, Vec<Point>)],
    slope: Option<Slope>,
) -> Result<String, String> {
    let expected = slope.map(|slope| expected(lines, slope)).unwrap_or_default();
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, (1480, 560)).into_drawing_area();
        root.fill(&WHITE).map_err(|e| e.to_string())?;
        let root = root.titled(title, ("sans-serif", 22)).map_err(|e| e.to_string())?;
        let (charts, legend) = root.split_horizontally(1200);
        let panels = charts.split_evenly((1, 2));
        panel(&panels[0], (lines, &expected), "spacing h", |p| p.spacing)?;
        panel(&panels[1], (lines, &[]), seconds, |p| p.seconds)?;
        chart::legend(&legend, lines.iter().map(|(label, _)| label))?;
        root.present().map_err(|e| e.to_string())?;
    }
    Ok(text)
}

/// The line of an order over the spacings of the runs.
fn expected(lines: &[(String, Vec<Point>)], slope: Slope) -> Vec<(f64, f64)> {
    let Some((_, points)) = lines.get(slope.line) else { return Vec::new() };
    let Some(finest) = points.iter().min_by(|a, b| a.spacing.total_cmp(&b.spacing)) else { return Vec::new() };
    let error_at = |spacing: f64| finest.error * (spacing / finest.spacing).powf(slope.order);
    points.iter().map(|point| (point.spacing, error_at(point.spacing))).collect()
}

/// The order p of errors ~ h^p by least squares over the logarithms; None of fewer than two spacings.
#[must_use]
pub fn fitted_order(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> =
        points.iter().filter(|(h, e)| *h > 0.0 && *e > 0.0).map(|(h, e)| (h.ln(), e.ln())).collect();
    let n = logs.len() as f64;
    let (mx, my) = (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
    let bottom: f64 = logs.iter().map(|p| (p.0 - mx).powi(2)).sum();
    let top: f64 = logs.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    (bottom > 1e-12).then(|| top / bottom)
}

/// The range of positive values with some room; decades at least.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values
        .filter(|v| *v > 0.0 && v.is_finite())
        .fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
    if low <= high { low / 2.0..high * 2.0 } else { 0.1..10.0 }
}

/// Lines with their names, and points of the line that is expected.
type Content<'a> = (&'a [(String, Vec<Point>)], &'a [(f64, f64)]);

fn panel(
    area: &DrawingArea<SVGBackend, Shift>,
    (lines, expected): Content<'_>,
    axis: &str,
    x: fn(&Point) -> f64,
) -> Result<(), String> {
    let points = || lines.iter().flat_map(|(_, points)| points);
    let errors = points().map(|p| p.error).chain(expected.iter().map(|(_, error)| *error));
    let (across, up) = (range(points().map(x)), range(errors));
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(across.log_scale(), up.log_scale())
        .map_err(|e| e.to_string())?;
    chart
        .configure_mesh()
        .x_desc(axis)
        .x_labels(6)
        .y_labels(10)
        .y_desc("error")
        .x_label_formatter(&|v| format!("{v:.0e}"))
        .y_label_formatter(&|v| format!("{v:.0e}"))
        .light_line_style(BLACK.mix(0.05))
        .draw()
        .map_err(|e| e.to_string())?;
    let thin = ShapeStyle::from(&BLACK).stroke_width(1);
    chart.draw_series(std::iter::once(PathElement::new(expected.to_vec(), thin))).map_err(|e| e.to_string())?;
    for (k, (_, points)) in lines.iter().enumerate() {
        let places: Vec<(f64, f64)> = points.iter().map(|p| (x(p), p.error)).collect();
        let line = PathElement::new(places.clone(), style(k));
        chart.draw_series(std::iter::once(line)).map_err(|e| e.to_string())?;
        let dots = places.iter().map(|place| Circle::new(*place, 4, style(k).filled()));
        chart.draw_series(dots).map_err(|e| e.to_string())?;
    }
    Ok(())
}
