//! A box in shear: its images slide past each other along x (Lees and Edwards 1972), so that the fluids in it flow on an
//! average as γ (y − y_m), without walls.
//!
//! Velocities are kept about that flow. So they are the same in every image, and
//!
//! dx/dt = u + γ (y − y_m) e_x, du/dt = a − γ u_y e_x
//! with the accelerations a of differences of whole velocities.

use crate::geometry::{Domain, Vector};

/// The mean flow γ (y − y_m) along x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanShear {
    /// The axis y along which the flow changes: not x.
    pub axis: usize,
    /// The shear rate γ.
    pub rate: f64,
    /// The place y_m at which nothing flows: the middle of the box.
    pub middle: f64,
    /// The length of the box along y.
    pub length: f64,
}

impl MeanShear {
    /// The speed of the mean flow at a place.
    #[inline]
    #[must_use]
    pub fn speed<const D: usize>(&self, x: &Vector<D>) -> f64 {
        self.rate * (x[self.axis] - self.middle)
    }

    /// How far the image a period up has slid at a time.
    #[must_use]
    pub fn offset(&self, time: f64) -> f64 {
        self.rate * self.length * time
    }

    /// The box at a time.
    #[must_use]
    pub fn domain<const D: usize>(&self, domain: &Domain<D>, time: f64) -> Domain<D> {
        domain.tilted(self.axis, self.offset(time))
    }

    /// The way of a particle in a step with a velocity u about the mean flow.
    #[inline]
    pub(super) fn way<const D: usize>(&self, x: &Vector<D>, u: &Vector<D>, step: f64) -> Vector<D> {
        let mut way = u * step;
        way[0] += self.speed(x) * step + 0.5 * self.rate * u[self.axis] * step * step;
        way
    }

    /// The velocity about the mean flow after a step with an acceleration.
    #[inline]
    pub(super) fn kicked<const D: usize>(&self, u: &Vector<D>, a: &Vector<D>, step: f64) -> Vector<D> {
        let mut kicked = u + a * step;
        kicked[0] -= self.rate * (u[self.axis] + 0.5 * a[self.axis] * step) * step;
        kicked
    }
}

#[cfg(test)]
mod tests {
    use super::MeanShear;
    use crate::geometry::Vector;

    /// With a constant acceleration kicks and ways of half steps come to those of whole ones.
    #[test]
    fn free_particles_in_shear_keep_their_whole_velocity() {
        let shear = MeanShear { axis: 1, rate: 0.7, middle: 0.2, length: 2.0 };
        let (mut x, mut u) = (Vector::<2>::new(0.1, 0.5), Vector::<2>::new(0.3, -0.4));
        let whole = |x: &Vector<2>, u: &Vector<2>| u + Vector::<2>::new(shear.speed(x), 0.0);
        let (start, velocity) = (x, whole(&x, &u));
        for _ in 0..4 {
            let nothing = Vector::<2>::zeros();
            let half = shear.kicked(&u, &nothing, 0.125);
            let way = shear.way(&x, &half, 0.25);
            x += way;
            u = shear.kicked(&half, &nothing, 0.125);
        }
        assert!((whole(&x, &u) - velocity).norm() < 1e-14, "{u}");
        assert!((x - start - velocity).norm() < 1e-14, "{x}");
        let accelerated = shear.kicked(&u, &Vector::<2>::new(0.0, 2.0), 0.5);
        let parts = (0..1000).fold(u, |u, _| shear.kicked(&u, &Vector::<2>::new(0.0, 2.0), 5e-4));
        assert!((accelerated - parts).norm() < 1e-12);
    }
}
