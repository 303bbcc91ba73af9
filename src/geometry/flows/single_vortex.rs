//! The spiraling vortex in the unit square (LeVeque 1996; PCP eq. 23, and GBPM eq. 21 without reversal).

use super::{Flow, Vector};
use std::f64::consts::PI;

/// The flow u = 2 cos(π t/T) (−sin²(πx) sin(πy) cos(πy), sin²(πy) sin(πx) cos(πx)). Without a period the first cosine
/// is 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SingleVortex {
    /// Period T: the flow reverses at T/2 and has returned every point at T. With None it never reverses.
    pub period: Option<f64>,
}

impl Flow<2> for SingleVortex {
    fn velocity(&self, x: &Vector<2>, time: f64) -> Vector<2> {
        let strength = self.period.map_or(1.0, |period| (PI * time / period).cos());
        // sin² a = (1 − cos 2a)/2 and 2 sin a cos a = sin 2a halve the number of trigonometric calls.
        let (sin_x, cos_x) = (2.0 * PI * x[0]).sin_cos();
        let (sin_y, cos_y) = (2.0 * PI * x[1]).sin_cos();
        Vector::<2>::new(-0.5 * strength * (1.0 - cos_x) * sin_y, 0.5 * strength * (1.0 - cos_y) * sin_x)
    }

    fn keeps_volume(&self, _low: &Vector<2>, _high: &Vector<2>) -> bool {
        true
    }

    fn top_speed(&self, _low: &Vector<2>, _high: &Vector<2>) -> f64 {
        // Reached in the middle of each side of the unit square; a carried point may come anywhere.
        1.0
    }

    fn return_time(&self) -> Option<f64> {
        self.period
    }
}

#[cfg(test)]
mod tests {
    use super::super::sampling;
    use super::{Flow, SingleVortex, Vector};
    use std::f64::consts::PI;

    #[test]
    fn equals_the_formula_of_the_paper() {
        let flow = SingleVortex { period: Some(8.0) };
        for (x, y, t) in [(0.3, 0.8, 0.0), (0.61, 0.17, 2.5), (0.5, 0.75, 7.0), (-0.2, 1.3, 4.4)] {
            let u = flow.velocity(&Vector::<2>::new(x, y), t);
            let s = 2.0 * (PI * t / 8.0).cos();
            let (sx, cx, sy, cy) = ((PI * x).sin(), (PI * x).cos(), (PI * y).sin(), (PI * y).cos());
            let expected = Vector::<2>::new(-s * sx * sx * sy * cy, s * sy * sy * sx * cx);
            assert!((u - expected).norm() < 1e-15);
        }
    }

    #[test]
    fn the_bound_of_the_speed_is_reached_in_the_unit_square() {
        let flow = SingleVortex { period: None };
        let (low, high) = (Vector::<2>::zeros(), Vector::<2>::repeat(1.0));
        let (bound, sampled) = (flow.top_speed(&low, &high), sampling::top_speed(&flow, &low, &high, 4.0));
        assert!(sampled <= bound && sampled > 0.99 * bound, "{sampled}");
    }
}
