//! Lines and dots over one pair of axes, with a legend beside it (SVG).

use plotters::coord::Shift;
use plotters::coord::ranged1d::ValueFormatter;
use plotters::prelude::{
    ChartBuilder, Circle, Cross, DrawingArea, IntoDrawingArea, IntoFont, IntoLogRange, Palette, Palette99, PathElement,
    Ranged, SVGBackend, ShapeStyle, Text, WHITE,
};
use plotters::style::{BLACK, Color};
use std::ops::Range;

/// What is drawn.
#[derive(Debug, Clone, Default)]
pub struct Chart<'a> {
    /// Title above the chart.
    pub title: &'a str,
    /// Name of the abscissa.
    pub across: &'a str,
    /// Name of the ordinate.
    pub up: &'a str,
    /// Whether the ordinate is logarithmic.
    pub is_log: bool,
    /// Whether points of a line are joined.
    pub is_joined: bool,
    /// Labels and points.
    pub lines: Vec<(String, Vec<(f64, f64)>)>,
    /// Crosses for what is expected.
    pub marks: Vec<(f64, f64)>,
    /// A thin line for what is expected.
    pub expected: Vec<(f64, f64)>,
}

/// The look of line k.
pub(super) fn style(k: usize) -> ShapeStyle {
    ShapeStyle::from(&Palette99::pick(k).to_rgba()).stroke_width(2)
}

/// A label with the color of its line, one below another.
pub(super) fn legend<'a>(
    area: &DrawingArea<SVGBackend, Shift>,
    labels: impl Iterator<Item = &'a String>,
) -> Result<(), String> {
    for (k, label) in labels.enumerate() {
        let y = 60 + 24 * k as i32;
        area.draw(&PathElement::new(vec![(8, y), (34, y)], style(k))).map_err(|e| e.to_string())?;
        let font = ("sans-serif", 15).into_font();
        area.draw(&Text::new(label.clone(), (42, y - 8), font)).map_err(|e| e.to_string())?;
    }
    Ok(())
}

/// Points that can be drawn.
fn shown(points: &[(f64, f64)], is_log: bool) -> impl Iterator<Item = (f64, f64)> {
    points.iter().copied().filter(move |(x, y)| x.is_finite() && y.is_finite() && (!is_log || *y > 0.0))
}

fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low <= high { (low, high) } else { (0.0, 1.0) }
}

/// The chart as SVG.
///
/// # Errors
/// A message when it cannot be drawn.
pub fn draw(chart: &Chart) -> Result<String, String> {
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, (1040, 560)).into_drawing_area();
        root.fill(&WHITE).map_err(|e| e.to_string())?;
        let root = root.titled(chart.title, ("sans-serif", 22)).map_err(|e| e.to_string())?;
        let (area, beside) = root.split_horizontally(760);
        let all = || {
            let lines = chart.lines.iter().map(|(_, points)| points).chain([&chart.marks, &chart.expected]);
            lines.flat_map(|points| shown(points, chart.is_log))
        };
        let ((left, right), (low, high)) = (extent(all().map(|p| p.0)), extent(all().map(|p| p.1)));
        let across = left..right.max(left + 1e-12);
        if chart.is_log {
            panel(&area, chart, across, (low / 1.5..high * 1.5).log_scale())?;
        } else {
            let room = 0.05 * (high - low).max(1e-12);
            panel(&area, chart, across, low - room..high + room)?;
        }
        legend(&beside, chart.lines.iter().map(|(label, _)| label))?;
        root.present().map_err(|e| e.to_string())?;
    }
    Ok(text)
}

fn panel<Y>(area: &DrawingArea<SVGBackend, Shift>, chart: &Chart, across: Range<f64>, up: Y) -> Result<(), String>
where
    Y: plotters::coord::ranged1d::AsRangedCoord<Value = f64>,
    Y::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let mut axes = ChartBuilder::on(area)
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(72)
        .build_cartesian_2d(across, up)
        .map_err(|e| e.to_string())?;
    let mut mesh = axes.configure_mesh();
    mesh.x_desc(chart.across).y_desc(chart.up).x_labels(8).y_labels(8).light_line_style(BLACK.mix(0.05));
    let powers = |value: &f64| format!("{value:.0e}");
    if chart.is_log {
        mesh.y_label_formatter(&powers);
    }
    mesh.draw().map_err(|e| e.to_string())?;
    let thin = ShapeStyle::from(&BLACK).stroke_width(1);
    let expected: Vec<(f64, f64)> = shown(&chart.expected, chart.is_log).collect();
    axes.draw_series(std::iter::once(PathElement::new(expected, thin))).map_err(|e| e.to_string())?;
    for (k, (_, points)) in chart.lines.iter().enumerate() {
        if chart.is_joined {
            let line: Vec<(f64, f64)> = shown(points, chart.is_log).collect();
            axes.draw_series(std::iter::once(PathElement::new(line, style(k)))).map_err(|e| e.to_string())?;
        } else {
            let dots = shown(points, chart.is_log).map(|place| Circle::new(place, 3, style(k).filled()));
            axes.draw_series(dots).map_err(|e| e.to_string())?;
        }
    }
    let crosses = shown(&chart.marks, chart.is_log).map(|place| Cross::new(place, 6, thin.stroke_width(2)));
    axes.draw_series(crosses).map_err(|e| e.to_string())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{Chart, draw};

    #[test]
    fn what_is_no_number_is_left_out() {
        let points = vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, 0.0), (3.0, 10.0)];
        for is_log in [false, true] {
            let lines = vec![("one".to_owned(), points.clone())];
            let chart = Chart { title: "T", is_log, lines, marks: vec![(1.0, 2.0)], ..Chart::default() };
            let text = draw(&chart).unwrap();
            assert!(text.contains("one") && !text.contains("NaN"));
            assert_eq!(text.matches("<circle").count(), if is_log { 2 } else { 3 });
        }
    }
}
