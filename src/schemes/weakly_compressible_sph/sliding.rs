//! What images that slide do to a system: where they are, and what they put in.
//!
//! The power is −γ (Σ_pairs F_x y_ij + Σ m u_x u_y + τ ∫ n_x n_y dA), the mean shear stress by the volume of the box and γ (Irving and
//! Kirkwood 1950; Batchelor 1970).

use super::mean_shear::MeanShear;
use super::smoothed_delta::smoothed_delta;
use super::system::SphSystem;
use crate::geometry::Vector;

impl<const D: usize> SphSystem<D> {
    /// Slides the images of a box in shear to where they are at a time.
    pub(super) fn slide_images(&mut self, time: f64) {
        let Some(shear) = self.config.mean_shear else { return };
        self.domain = shear.domain(&self.domain, time);
        self.pairs.lists.slide_images(&self.domain, time);
        if let Some(level_set) = self.interface.level_set_mut() {
            level_set.set_domain(&self.domain);
        }
        self.droplets.set_domain(&self.domain);
        self.strays.set_domain(&self.domain);
    }

    /// Velocities of the particles, the mean flow included.
    pub(super) fn whole_velocities(&self) -> impl ExactSizeIterator<Item = Vector<D>> + '_ {
        let shear = self.config.mean_shear;
        self.flow.velocity.iter().zip(self.particles.positions()).map(move |(u, x)| match shear {
            Some(shear) => {
                let mut whole = *u;
                whole[0] += shear.speed(x);
                whole
            }
            None => *u,
        })
    }

    /// Σ_pairs F_x y_ij + Σ m u_x u_y + τ ∫ n_x n_y dA of a box in shear.
    fn virial(&self, shear: &MeanShear) -> f64 {
        let flow = &self.flow;
        let carried = |(i, u): (usize, &Vector<D>)| flow.mass(i) * u[0] * u[shear.axis];
        let carried: f64 = flow.velocity.iter().enumerate().map(carried).sum();
        self.rates.pair_virial + carried + self.config.tension * self.mixed_normals(shear.axis)
    }

    /// ∫ n_x n_y dA.
    fn mixed_normals(&self, axis: usize) -> f64 {
        let Some(level_set) = self.interface.level_set() else { return 0.0 };
        let (particles, columns) = (&self.particles, &self.columns);
        let (phi, band) = (particles.scalar(columns.phi), particles.flag(columns.in_band));
        let normal = particles.vector(columns.normal);
        let near = level_set.candidates().iter().copied().filter(|i| band[*i] == 1);
        let share = |i: usize| self.flow.volume[i] * smoothed_delta(phi[i], self.config.smoothing_length);
        near.map(|i| share(i) * normal[i][0] * normal[i][axis]).sum()
    }

    /// The mean shear stress of a box in shear.
    pub(super) fn shear_stress(&self) -> Option<f64> {
        let shear = self.config.mean_shear?;
        Some(-self.virial(&shear) / (self.flow.cell * self.flow.count() as f64))
    }

    /// The power that sliding images put in, and the force on the momentum about the mean flow.
    pub(super) fn shear_supply(&self) -> (f64, Vector<D>) {
        let Some(shear) = self.config.mean_shear else { return (0.0, Vector::<D>::zeros()) };
        let mut force = Vector::<D>::zeros();
        let along = self.flow.velocity.iter().enumerate().map(|(i, u)| self.flow.mass(i) * u[shear.axis]);
        force[0] = -shear.rate * along.sum::<f64>();
        (-shear.rate * self.virial(&shear), force)
    }
}
