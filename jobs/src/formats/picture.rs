//! A picture of frames side by side: particles colored by a number, the surface as a black line (SVG). 3D frames show
//! the particles of a slice through the middle.

use super::frame_view::FrameView;
use plotters::coord::Shift;
use plotters::prelude::{
    ChartBuilder, Circle, DrawingArea, IntoDrawingArea, PathElement, RGBColor, SVGBackend, ShapeStyle, WHITE,
};
use std::path::Path;

/// Width and height of one panel in pixels.
const PANEL: u32 = 480;
/// Particles that a panel draws at most; more are thinned out evenly.
const MOST_POINTS: usize = 20_000;

/// Draws frames of particles of the given spacing into an SVG file.
///
/// # Errors
/// A message when the file cannot be written.
pub fn draw(path: &Path, frames: &[FrameView], spacing: f64) -> Result<(), String> {
    let root = SVGBackend::new(path, (PANEL * frames.len().max(1) as u32, PANEL)).into_drawing_area();
    root.fill(&WHITE).map_err(|e| e.to_string())?;
    for (panel, frame) in root.split_evenly((1, frames.len().max(1))).iter().zip(frames) {
        draw_panel(panel, frame, spacing)?;
    }
    root.present().map_err(|e| e.to_string())
}

/// How far neighboring points are apart in pictures: the spacing of the scene, or as far as the diagonal of a frame's box and
/// the number of its points say.
#[must_use]
pub fn spacing(of_scene: Option<f64>, frames: &[FrameView]) -> f64 {
    let of_frame = || {
        let points = &frames.first()?.points;
        let of_axis = |d: usize| points.iter().map(move |x| x[d]);
        let side = |d: usize| of_axis(d).fold(f64::MIN, f64::max) - of_axis(d).fold(f64::MAX, f64::min);
        Some((0..3).map(|d| side(d).powi(2)).sum::<f64>().sqrt() / (points.len() as f64).sqrt())
    };
    of_scene.or_else(of_frame).filter(|h| h.is_normal()).unwrap_or(0.05)
}

fn draw_panel(panel: &DrawingArea<SVGBackend, Shift>, frame: &FrameView, spacing: f64) -> Result<(), String> {
    let slice = slice_of(frame, spacing);
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for &i in &slice {
        for d in 0..2 {
            low[d] = low[d].min(frame.points[i][d]);
            high[d] = high[d].max(frame.points[i][d]);
        }
    }
    // One scale for both axes, so that circles look like circles.
    let half = 0.5 * (high[0] - low[0]).max(high[1] - low[1]) + spacing;
    let half = if half.is_finite() { half } else { 1.0 };
    let middle = [0, 1].map(|d| if low[d].is_finite() { 0.5 * (low[d] + high[d]) } else { 0.0 });
    let mut chart = ChartBuilder::on(panel)
        .caption(format!("t = {:.4}", frame.time), ("sans-serif", 18))
        .margin(10)
        .x_label_area_size(24)
        .y_label_area_size(36)
        .build_cartesian_2d(middle[0] - half..middle[0] + half, middle[1] - half..middle[1] + half)
        .map_err(|e| e.to_string())?;
    chart.configure_mesh().disable_mesh().x_labels(5).y_labels(5).draw().map_err(|e| e.to_string())?;
    let extreme = frame.values.iter().filter(|v| v.is_finite()).fold(1e-300_f64, |most, v| most.max(v.abs()));
    let thinning = slice.len().div_ceil(MOST_POINTS).max(1);
    let radius = (0.35 * spacing / (2.0 * half) * f64::from(PANEL)).clamp(0.5, 5.0) as i32;
    let dots = slice.iter().step_by(thinning).map(|&i| {
        let style = ShapeStyle::from(&color(frame.values[i] / extreme)).filled();
        Circle::new((frame.points[i][0], frame.points[i][1]), radius.max(1), style)
    });
    chart.draw_series(dots).map_err(|e| e.to_string())?;
    // Near the surface every particle knows its closest point and normal: short tangents there join to a line.
    let line =
        slice.iter().filter(|&&i| frame.values[i].abs() <= 2.0 * spacing && !frame.surface.is_empty()).map(|&i| {
            let (point, normal) = frame.surface[i];
            let reach = 0.35 * spacing;
            let ends = [-1.0, 1.0].map(|s| (point[0] - s * reach * normal[1], point[1] + s * reach * normal[0]));
            PathElement::new(ends.to_vec(), ShapeStyle::from(&RGBColor(0, 0, 0)).stroke_width(2))
        });
    chart.draw_series(line).map_err(|e| e.to_string())?;
    Ok(())
}

/// All particles of a plane frame; of a 3D one those within half a spacing of its middle plane.
fn slice_of(frame: &FrameView, spacing: f64) -> Vec<usize> {
    let (low, high) =
        frame.points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p[2]), high.max(p[2])));
    let middle = 0.5 * (low + high);
    let all = 0..frame.points.len();
    if low < high {
        all.filter(|&i| (frame.points[i][2] - middle).abs() <= 0.5 * spacing).collect()
    } else {
        all.collect()
    }
}

/// Blue inside, white at the surface, red outside, grey where there is no value.
fn color(value: f64) -> RGBColor {
    if !value.is_finite() {
        return RGBColor(200, 200, 200);
    }
    let strength = value.abs().min(1.0).sqrt();
    let fade = |full: f64| (235.0 + (full - 235.0) * strength) as u8;
    if value < 0.0 {
        RGBColor(fade(30.0), fade(80.0), fade(190.0))
    } else {
        RGBColor(fade(190.0), fade(50.0), fade(40.0))
    }
}
