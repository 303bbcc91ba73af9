//! A layer between two surfaces that are plane or carry waves, across all of space.

use super::Vector;
use std::f64::consts::TAU;

/// Points with |y − height| below thickness/2 + amplitude · cos(2π (x − crest)/wavelength), in space for all z.
///
/// It is no [`super::Surface`]: it is not bounded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WavyLayer {
    /// Height y of the middle.
    pub height: f64,
    /// Mean distance of the two sides.
    pub thickness: f64,
    /// Amplitude of the waves on both sides, below half the thickness.
    pub amplitude: f64,
    /// Length of the waves.
    pub wavelength: f64,
    /// Place x of a crest.
    pub crest: f64,
}

/// Places along a wave from which the closest one is refined.
const PLACES: usize = 65;
/// Steps of the refinement at most; each halves the interval at least.
const MOST_STEPS: usize = 60;

impl WavyLayer {
    /// Signed distance of `x` from the sides, positive outside, exact to round-off.
    #[must_use]
    pub fn signed_distance<const D: usize>(&self, x: &Vector<D>) -> f64 {
        let along = x[0] - self.crest;
        let y = x[1] - self.height;
        // The lower side is the mirror image of the upper one.
        let upper = self.distance_from_side(along, y);
        let lower = self.distance_from_side(along, -y);
        let is_inside = y.abs() < self.side(along);
        if is_inside { -upper.min(lower) } else { upper.min(lower) }
    }

    /// Height of the upper side above the middle.
    fn side(&self, along: f64) -> f64 {
        0.5 * self.thickness + self.amplitude * (TAU * along / self.wavelength).cos()
    }

    /// Slope of the upper side.
    fn slope(&self, along: f64) -> f64 {
        let k = TAU / self.wavelength;
        -self.amplitude * k * (k * along).sin()
    }

    /// Distance of (`along`, `y`) from the upper side.
    fn distance_from_side(&self, along: f64, y: f64) -> f64 {
        let vertical = (y - self.side(along)).abs();
        // No closer point lies farther along than the one above, nor farther than half a wave.
        let reach = vertical.min(0.5 * self.wavelength);
        let place = |k: usize| along + reach * (2.0 * k as f64 / (PLACES - 1) as f64 - 1.0);
        let square = |s: f64| (s - along).powi(2) + (self.side(s) - y).powi(2);
        let nearest = (0..PLACES).min_by(|a, b| square(place(*a)).total_cmp(&square(place(*b)))).unwrap_or(0);
        let (mut low, mut high) = (place(nearest.saturating_sub(1)), place((nearest + 1).min(PLACES - 1)));
        // Zero of the derivative of half the square, by bisection: it rises through the minimum.
        let derivative = |s: f64| s - along + (self.side(s) - y) * self.slope(s);
        for _ in 0..MOST_STEPS {
            let middle = 0.5 * (low + high);
            if derivative(middle) < 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        square(0.5 * (low + high)).sqrt().min(vertical)
    }
}

#[cfg(test)]
mod tests {
    use super::{Vector, WavyLayer};

    #[test]
    fn distances_from_a_plane_layer_are_heights() {
        let layer = WavyLayer { height: 0.2, thickness: 0.6, amplitude: 0.0, wavelength: 1.0, crest: 0.0 };
        for (y, expected) in [(0.2, -0.3), (0.6, 0.1), (-0.3, 0.2), (0.45, -0.05)] {
            assert!((layer.signed_distance(&Vector::<2>::new(0.37, y)) - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn distances_from_waves_are_those_of_the_closest_of_many_points() {
        let layer = WavyLayer { height: 0.1, thickness: 0.8, amplitude: 0.2, wavelength: 0.9, crest: 0.13 };
        for k in 0..200 {
            let at = |n: i32| f64::from((k * n) % 199) / 199.0;
            let x = Vector::<3>::new(2.0 * at(7) - 1.0, 2.0 * at(31) - 0.9, at(3));
            let points = (0..200_000).map(|m| {
                let along = x[0] - layer.crest - 1.0 + 1e-5 * f64::from(m);
                let side = layer.side(along);
                let across = (x[1] - layer.height - side).abs().min((x[1] - layer.height + side).abs());
                (along - (x[0] - layer.crest)).hypot(across)
            });
            let nearest = points.fold(f64::INFINITY, f64::min);
            let distance = layer.signed_distance(&x);
            assert!((distance.abs() - nearest).abs() < 1e-5, "{x}: {distance}, {nearest}");
            assert_eq!(distance < 0.0, (x[1] - layer.height).abs() < layer.side(x[0] - layer.crest));
        }
    }
}
