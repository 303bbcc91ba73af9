//! Error over spacing and over CPU time, log-log, one line a method (SVG).

use meniscus::scene::rows::Figure;
use plotters::coord::Shift;
use plotters::prelude::{
    ChartBuilder, Circle, DrawingArea, IntoDrawingArea, IntoLogRange, Palette, Palette99, PathElement, SVGBackend,
    SeriesLabelPosition, ShapeStyle, WHITE,
};
use plotters::style::{BLACK, Color};
use std::ops::Range;
use std::path::Path;

/// One run.
#[derive(Debug, Clone, Copy)]
pub struct Point {
    /// h.
    pub spacing: f64,
    /// CPU seconds.
    pub seconds: f64,
    /// The error.
    pub error: f64,
}

type Lines = [(String, Vec<Point>)];

/// Draws both pictures side by side.
///
/// # Errors
/// A message when the file cannot be written.
pub fn draw(path: &Path, figure: &Figure, lines: &Lines) -> Result<(), String> {
    let root = SVGBackend::new(path, (1240, 560)).into_drawing_area();
    root.fill(&WHITE).map_err(|e| e.to_string())?;
    let root = root.titled(figure.title, ("sans-serif", 22)).map_err(|e| e.to_string())?;
    let panels = root.split_evenly((1, 2));
    panel(&panels[0], lines, "spacing h", |p| p.spacing, false)?;
    panel(&panels[1], lines, "CPU seconds of redistancing", |p| p.seconds, true)?;
    root.present().map_err(|e| e.to_string())
}

/// The range of positive values with some room; decades at least.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values
        .filter(|v| *v > 0.0 && v.is_finite())
        .fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
    if low <= high { low / 2.0..high * 2.0 } else { 0.1..10.0 }
}

fn panel(
    area: &DrawingArea<SVGBackend, Shift>,
    lines: &Lines,
    axis: &str,
    x: fn(&Point) -> f64,
    with_legend: bool,
) -> Result<(), String> {
    let points = || lines.iter().flat_map(|(_, points)| points);
    let (across, up) = (range(points().map(x)), range(points().map(|p| p.error)));
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(across.log_scale(), up.log_scale())
        .map_err(|e| e.to_string())?;
    chart
        .configure_mesh()
        .x_desc(axis)
        .y_desc("error")
        .x_label_formatter(&|v| format!("{v:.0e}"))
        .y_label_formatter(&|v| format!("{v:.0e}"))
        .light_line_style(BLACK.mix(0.05))
        .draw()
        .map_err(|e| e.to_string())?;
    for (k, (label, points)) in lines.iter().enumerate() {
        let colour = Palette99::pick(k).to_rgba();
        let style = ShapeStyle::from(&colour).stroke_width(2);
        let places: Vec<(f64, f64)> = points.iter().map(|p| (x(p), p.error)).collect();
        chart
            .draw_series(std::iter::once(PathElement::new(places.clone(), style)))
            .map_err(|e| e.to_string())?
            .label(label.clone())
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], style));
        let dots = places.iter().map(|place| Circle::new(*place, 4, style.filled()));
        chart.draw_series(dots).map_err(|e| e.to_string())?;
    }
    if with_legend {
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK.mix(0.3))
            .draw()
            .map_err(|e| e.to_string())?;
    }
    Ok(())
}
