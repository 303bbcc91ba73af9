//! The deforming flow in the unit cube (LeVeque 1996; GBPM eq. 24).

use super::{Flow, Stretch, Vector};
use std::f64::consts::PI;

/// The flow u = cos(π t/T) (2 sin²(πx) sin(2πy) sin(2πz), −sin(2πx) sin²(πy) sin(2πz), −sin(2πx) sin(2πy) sin²(πz)).
///
/// Without a period the cosine is 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vortex3d {
    /// Period T: the flow reverses at T/2 and has returned every point at T. With None it never reverses.
    pub period: Option<f64>,
}

impl Flow<3> for Vortex3d {
    fn velocity(&self, x: &Vector<3>, time: f64) -> Vector<3> {
        let strength = self.period.map_or(1.0, |period| (PI * time / period).cos());
        // 2 sin² a = 1 − cos 2a.
        let [(sx, cx), (sy, cy), (sz, cz)] = [x[0], x[1], x[2]].map(|c| (2.0 * PI * c).sin_cos());
        Vector::<3>::new((1.0 - cx) * sy * sz, -0.5 * sx * (1.0 - cy) * sz, -0.5 * sx * sy * (1.0 - cz)) * strength
    }

    fn keeps_volume(&self, _low: &Vector<3>, _high: &Vector<3>) -> bool {
        true
    }

    fn top_speed(&self, _low: &Vector<3>, _high: &Vector<3>) -> f64 {
        // |u₁| ≤ 2 where the others vanish; a carried point may come anywhere.
        2.0
    }

    fn typical_stretch(&self) -> Option<Stretch> {
        // At T/2 the sphere of GBPM 4.3 has about four times its area; half of that is the mean over a period.
        Some(Stretch { mean: 2.0, most: 4.0 })
    }

    fn return_time(&self) -> Option<f64> {
        self.period
    }
}

#[cfg(test)]
mod tests {
    use super::super::sampling;
    use super::{Flow, Vector, Vortex3d};
    use std::f64::consts::PI;

    #[test]
    fn equals_the_formula_of_the_paper_and_keeps_volumes() {
        let flow = Vortex3d { period: Some(2.0) };
        for (x, y, z, t) in [(0.3, 0.8, 0.1, 0.0), (0.61, 0.17, 0.9, 0.7), (-0.2, 1.3, 0.55, 1.4)] {
            let at = Vector::<3>::new(x, y, z);
            let u = flow.velocity(&at, t);
            let [(sx, _), (sy, _), (sz, _)] = [x, y, z].map(|c| (PI * c).sin_cos());
            let [(dx, _), (dy, _), (dz, _)] = [x, y, z].map(|c| (2.0 * PI * c).sin_cos());
            let s = (PI * t / 2.0).cos();
            let expected = Vector::<3>::new(2.0 * sx * sx * dy * dz, -dx * sy * sy * dz, -dx * dy * sz * sz) * s;
            assert!((u - expected).norm() < 1e-15);
            let h = 1e-5;
            let divergence: f64 = (0..3)
                .map(|d| {
                    let mut e = Vector::<3>::zeros();
                    e[d] = h;
                    (flow.velocity(&(at + e), t)[d] - flow.velocity(&(at - e), t)[d]) / (2.0 * h)
                })
                .sum();
            assert!(divergence.abs() < 1e-8);
        }
    }

    #[test]
    fn the_bound_of_the_speed_is_reached_in_the_unit_cube() {
        let flow = Vortex3d { period: None };
        let (low, high) = (Vector::<3>::zeros(), Vector::<3>::repeat(1.0));
        let (bound, sampled) = (flow.top_speed(&low, &high), sampling::top_speed(&flow, &low, &high, 3.0));
        assert!(sampled <= bound && sampled > 0.95 * bound, "{sampled}");
    }
}
