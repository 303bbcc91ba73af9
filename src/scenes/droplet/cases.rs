//! The cases: what holds for each when it is not given.

use super::spec::{BoxSpec, CaseName, DensityChoice, ForceChoice, Shifting};
use crate::scenes::shapes::Shape;
use crate::spec::Coordinates;

/// A case in a dimension, at a spacing.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Case {
    /// The drop at the start; a custom one has none.
    pub shape: Option<Shape>,
    pub domain: BoxSpec,
    pub tension: f64,
    pub density_method: DensityChoice,
    pub shifting: Shifting,
    pub body_force: ForceChoice,
    pub time_step: Option<f64>,
    /// Smoothing length ε in h.
    pub smoothing_h: f64,
    /// Degree of the fits, and their radius in h.
    pub fits: (usize, f64),
}

/// Coefficient of the density diffusion, where none is given.
pub(super) const DEFAULT_DIFFUSION: f64 = 0.05;

/// ε/h that grows with the resolution, as in the paper: 3 at 1/32, 3.25 at 1/48, … 3.75 at 1/80.
fn growing_smoothing(spacing: f64) -> f64 {
    3.0 + 0.25 * ((1.0 / spacing - 32.0) / 16.0).clamp(0.0, 3.0)
}

/// A box about the origin with these half edge lengths; in the plane the first two count.
fn centered_box(dimension: usize, half: [f64; 3]) -> BoxSpec {
    let high: Vec<f64> = half.into_iter().take(dimension).collect();
    BoxSpec { low: Coordinates(high.iter().map(|x| -x).collect()), high: Coordinates(high), axes: None }
}

impl Case {
    /// The case of a name.
    pub fn new(name: CaseName, dimension: usize, spacing: f64) -> Self {
        match name {
            CaseName::Oscillating => Self::oscillating(dimension),
            CaseName::Dividing => Self::dividing(dimension, spacing),
            CaseName::Static => Self { shape: Some(Shape::ball(dimension, 0.5)), ..Self::oscillating(dimension) },
            CaseName::Custom => Self { shape: None, ..Self::oscillating(dimension) },
        }
    }

    /// PCP, section 4.3.
    fn oscillating(dimension: usize) -> Self {
        let is_flat = dimension == 2;
        Self {
            shape: Some(Shape::ellipsoid(dimension, [0.75, 0.5, 0.5])),
            domain: centered_box(dimension, [1.22; 3]),
            tension: if is_flat { 50.0 } else { 25.0 },
            density_method: DensityChoice::Summation,
            shifting: Shifting::None,
            body_force: ForceChoice::None,
            time_step: None,
            smoothing_h: if is_flat { 3.0 } else { 2.0 },
            fits: (4, 2.8),
        }
    }

    /// PCP, section 4.4.
    fn dividing(dimension: usize, spacing: f64) -> Self {
        let is_flat = dimension == 2;
        let half = if is_flat { [1.0, 0.5, 0.0] } else { [0.75, 0.390_625, 0.390_625] };
        // Without force where the halves come to stay, and half way to it across (docs/errata.md).
        let body_force = if is_flat {
            ForceChoice::Pulse { coefficient: 1000.0, duration: 0.5, a: 0.5, b: 0.5, c: 0.5 }
        } else {
            ForceChoice::Pulse { coefficient: 5000.0, duration: 0.05, a: 0.375, b: 0.390_625, c: 0.390_625 }
        };
        Self {
            shape: Some(Shape::ball(dimension, 0.25)),
            domain: centered_box(dimension, half),
            tension: 5.0,
            density_method: DensityChoice::Continuity { diffusion: DEFAULT_DIFFUSION },
            shifting: Shifting::Pst,
            body_force,
            time_step: Some(if is_flat { 1e-4 } else { 1.5e-4 }),
            smoothing_h: if is_flat { growing_smoothing(spacing) } else { 2.0 },
            fits: (3, 3.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::growing_smoothing;

    #[test]
    fn smoothing_grows_as_in_the_paper() {
        for (cells, expected) in [(32.0, 3.0), (48.0, 3.25), (64.0, 3.5), (80.0, 3.75), (16.0, 3.0)] {
            assert_eq!(growing_smoothing(1.0 / cells), expected);
        }
    }
}
