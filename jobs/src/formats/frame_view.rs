//! What a picture needs of a frame, by what the scene says is to be seen.

use super::surface_view::seen;
use super::vtkhdf::Frame;
use meniscus::scene::View;
use std::path::Path;

/// What a picture draws of one frame.
#[derive(Debug, Clone, Default)]
pub struct FrameView {
    /// Scene time of the frame.
    pub time: f64,
    /// Positions of the points to draw.
    pub points: Vec<[f64; 3]>,
    /// The number that colors each point, NaN where there is none: a signed distance, or a field less the middle of its
    /// range.
    pub values: Vec<f64>,
    /// Points of the surface and normals there, one for each point; empty where the surface is not drawn.
    pub surface: Vec<([f64; 3], [f64; 3])>,
}

/// Reads what a picture shows of a frame; None where there is no picture, or the frame lacks a field that it needs.
///
/// # Errors
/// Errors of libhdf5.
pub fn read(path: &Path, view: View) -> hdf5::Result<Option<FrameView>> {
    let frame = Frame::open(path)?;
    match view {
        View::Nothing => Ok(None),
        View::Distance { distance, closest_point, normal } => {
            let Some(values) = frame.scalars(distance)? else { return Ok(None) };
            let feet = frame.vectors(closest_point)?.zip(frame.vectors(normal)?);
            let surface = feet.map(|(points, normals)| points.into_iter().zip(normals).collect()).unwrap_or_default();
            Ok(Some(FrameView { time: frame.time()?, points: frame.points()?, values, surface }))
        }
        View::SurfaceField { field, normal, is_plane } => {
            let Some((values, normals)) = frame.scalars(field)?.zip(frame.vectors(normal)?) else { return Ok(None) };
            surface_field(&frame, &values, &normals, is_plane).map(Some)
        }
        View::Front { normal, is_plane } => {
            let Some(normals) = frame.vectors(normal)? else { return Ok(None) };
            if is_plane { curve(&frame, normals).map(Some) } else { slopes(&frame, &normals).map(Some) }
        }
    }
}

fn surface_field(frame: &Frame, values: &[f64], normals: &[[f64; 3]], is_plane: bool) -> hdf5::Result<FrameView> {
    let points = frame.points()?;
    let middle = middle(values);
    let values: Vec<f64> = values.iter().map(|value| value - middle).collect();
    let (points, values) = if is_plane { (points, values) } else { seen(&points, normals, &values) };
    Ok(FrameView { time: frame.time()?, points, values, surface: Vec::new() })
}

/// A front in the plane. A wave front in (x, y, θ) is drawn in the plane, too.
fn curve(frame: &Frame, normals: Vec<[f64; 3]>) -> hdf5::Result<FrameView> {
    let points: Vec<[f64; 3]> = frame.points()?.iter().map(|x| [x[0], x[1], 0.0]).collect();
    let values = vec![0.0; points.len()];
    let surface = points.iter().copied().zip(normals).collect();
    Ok(FrameView { time: frame.time()?, points, values, surface })
}

/// A front in space, shaded by its slope.
fn slopes(frame: &Frame, normals: &[[f64; 3]]) -> hdf5::Result<FrameView> {
    let slopes: Vec<f64> = normals.iter().map(|n| n[2]).collect();
    surface_field(frame, &slopes, normals, false)
}

/// The middle of the range of numbers.
fn middle(values: &[f64]) -> f64 {
    let finite = || values.iter().filter(|value| value.is_finite());
    let low = finite().fold(f64::INFINITY, |low, value| low.min(*value));
    let high = finite().fold(f64::NEG_INFINITY, |high, value| high.max(*value));
    0.5 * (low + high)
}
