//! Rays of geometrical optics in (x, y, θ), θ the direction of travel.

use super::{Flow, Vector};

/// dx/dt = c cos θ, dy/dt = c sin θ, dθ/dt = 0 (GBPM eq. 23 with a constant speed c).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rays {
    /// Speed c of the wave front.
    pub speed: f64,
}

impl Flow<3> for Rays {
    fn velocity(&self, x: &Vector<3>, _time: f64) -> Vector<3> {
        Vector::<3>::new(x[2].cos(), x[2].sin(), 0.0) * self.speed
    }

    fn top_speed(&self, _low: &Vector<3>, _high: &Vector<3>) -> f64 {
        self.speed.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::super::sampling;
    use super::{Flow, Rays, Vector};

    #[test]
    fn the_speed_is_the_same_everywhere() {
        let (flow, low, high) = (Rays { speed: -1.5 }, Vector::<3>::zeros(), Vector::<3>::repeat(7.0));
        let (bound, sampled) = (flow.top_speed(&low, &high), sampling::top_speed(&flow, &low, &high, 1.0));
        assert!((bound - sampled).abs() < 1e-12 && (bound - 1.5).abs() < 1e-15);
        assert!(!flow.is_rigid() && flow.return_time().is_none() && flow.typical_stretch().is_none());
    }
}
