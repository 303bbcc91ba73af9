//! The flow that particles carry, and its rates of change.

use super::fluids::Fluid;
use super::species::{Fluids, Species};
use crate::geometry::Vector;

/// Columns of the flow, one entry a particle.
#[derive(Debug)]
pub(super) struct FlowState<const D: usize> {
    /// The fluid of each species.
    pub fluids: Fluids,
    /// The volume of a particle at rest.
    pub cell: f64,
    pub species: Vec<Species>,
    pub velocity: Vec<Vector<D>>,
    /// Velocities that viscosity and continuity use: those of the end of the step as an integrator predicts them.
    pub predicted: Vec<Vector<D>>,
    pub density: Vec<f64>,
    /// Derived from densities, or summed.
    pub volume: Vec<f64>,
    /// Derived from densities by the equation of state.
    pub pressure: Vec<f64>,
    /// The factor a of volumes by summation, V_i = a/Σ_j W_ij.
    pub calibration: f64,
    /// The factor of viscosities that makes the sums over pairs exact on the lattice of the start; 1 where it is not found.
    pub viscosity_factor: f64,
    /// The background pressure p_b, the same for both fluids.
    pub background: f64,
    /// Pressures of the bulk damping; empty without it.
    pub bulk_pressure: Vec<f64>,
    /// Volumes at the last evaluation, for the bulk damping; empty without it.
    pub last_volume: Vec<f64>,
}

/// Rates of change, one entry a particle.
#[derive(Debug)]
pub(super) struct Rates<const D: usize> {
    pub acceleration: Vec<Vector<D>>,
    /// Rates of density; empty where densities are not integrated.
    pub density: Vec<f64>,
    /// Σ_pairs F_x y_ij of a box in shear; 0 elsewhere.
    pub pair_virial: f64,
}

impl<const D: usize> FlowState<D> {
    /// Fluids with one velocity and no pressure, with the species of the signed distances in `level`.
    pub fn in_motion(fluids: Fluids, cell: f64, level: &[f64], velocity: Vec<Vector<D>>) -> Self {
        let species: Vec<Species> = level.iter().map(|level| Species::from_level(*level)).collect();
        let count = species.len();
        Self {
            density: species.iter().map(|species| fluids[*species].density).collect(),
            predicted: velocity.clone(),
            velocity,
            volume: vec![cell; count],
            pressure: vec![0.0; count],
            calibration: 1.0,
            viscosity_factor: 1.0,
            background: 0.0,
            bulk_pressure: Vec::new(),
            last_volume: Vec::new(),
            fluids,
            cell,
            species,
        }
    }

    /// The pressure with which particles act on each other: equation of state, background and bulk damping.
    pub fn pair_pressure(&self, i: usize) -> f64 {
        self.pressure[i] + self.background + self.bulk_pressure.get(i).copied().unwrap_or(0.0)
    }

    /// Sets the pressures of the bulk damping, −β ρ c ε (V − V_last)/(Δt V), from the volumes now and those a time `elapsed`
    /// ago. `damping` is β ε. Without a last evaluation they are 0.
    pub fn damp_bulk(&mut self, damping: f64, elapsed: f64) {
        let count = self.count();
        if self.last_volume.len() != count || elapsed <= 0.0 {
            self.bulk_pressure.clear();
            self.bulk_pressure.resize(count, 0.0);
        } else {
            for i in 0..count {
                let (volume, density) = (self.volume[i], self.density[i]);
                let expansion = (volume - self.last_volume[i]) / (elapsed * volume);
                self.bulk_pressure[i] = -damping * density * self.fluid(i).sound_speed * expansion;
            }
        }
        self.last_volume.clone_from(&self.volume);
    }

    /// The number of particles.
    pub fn count(&self) -> usize {
        self.species.len()
    }

    /// The fluid of a particle.
    pub fn fluid(&self, i: usize) -> &Fluid {
        &self.fluids[self.species[i]]
    }

    /// The mass of a particle.
    pub fn mass(&self, i: usize) -> f64 {
        self.fluid(i).density * self.cell
    }

    /// Sets volumes to those of the present densities.
    pub fn derive_volumes(&mut self) {
        for i in 0..self.count() {
            self.volume[i] = self.mass(i) / self.density[i];
        }
    }

    /// Sets densities to those of the present volumes.
    pub fn derive_densities(&mut self) {
        for i in 0..self.count() {
            self.density[i] = self.mass(i) / self.volume[i];
        }
    }

    /// Sets pressures to those of the present densities.
    pub fn derive_pressures(&mut self) {
        let states = self.pressure.iter_mut().zip(&self.density).zip(&self.species);
        for ((pressure, density), species) in states {
            *pressure = self.fluids[*species].pressure(*density);
        }
    }

    /// The largest speed about the mean velocity Σ m u/Σ m.
    pub fn largest_relative_speed(&self) -> f64 {
        let mass: f64 = (0..self.count()).map(|i| self.mass(i)).sum();
        let momentum: Vector<D> = self.velocity.iter().enumerate().map(|(i, u)| u * self.mass(i)).sum();
        self.largest_speed_about(&(momentum / mass))
    }

    /// The largest speed about a velocity.
    pub fn largest_speed_about(&self, velocity: &Vector<D>) -> f64 {
        self.velocity.iter().map(|u| (u - velocity).norm_squared()).fold(0.0, f64::max).sqrt()
    }

    /// The largest speed.
    pub fn largest_speed(&self) -> f64 {
        self.velocity.iter().map(Vector::<D>::norm_squared).fold(0.0, f64::max).sqrt()
    }
}

impl<const D: usize> Rates<D> {
    /// Rates of zero.
    pub fn none(count: usize, is_density_integrated: bool) -> Self {
        Self {
            pair_virial: 0.0,
            acceleration: vec![Vector::<D>::zeros(); count],
            density: vec![0.0; if is_density_integrated { count } else { 0 }],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{FlowState, Fluid, Fluids, Species, Vector};

    #[test]
    fn fluids_at_rest_have_no_pressure_and_volumes_and_densities_lead_back_to_each_other() {
        let fluid = |density| Fluid { density, viscosity: 0.5, sound_speed: 20.0, polytropic: 7.0 };
        let mut flow = FlowState::<2>::in_motion(
            Fluids { inside: fluid(3.0), outside: fluid(1.0) },
            0.25,
            &[-1.0, 1.0],
            vec![Vector::<2>::zeros(); 2],
        );
        assert_eq!(flow.species, [Species::Inside, Species::Outside]);
        assert_eq!((flow.mass(0), flow.mass(1)), (0.75, 0.25));
        flow.derive_pressures();
        assert_eq!(flow.pressure, [0.0, 0.0]);
        flow.volume = vec![0.2, 0.3];
        flow.derive_densities();
        flow.derive_pressures();
        assert!(flow.pressure[0] > 0.0 && flow.pressure[1] < 0.0, "{:?}", flow.pressure);
        flow.volume = vec![0.0, 0.0];
        flow.derive_volumes();
        assert!((flow.volume[0] - 0.2).abs() < 1e-15 && (flow.volume[1] - 0.3).abs() < 1e-15);
    }
}
