//! The flow by DC-PSE instead of sums over kernels (PCP section 4.3). Gradients of pressure and velocity and their Laplacians
//! come from fits around every particle, renewed at every evaluation, since particles move.
//!
//! du_i/dt = (η Δu − ∇P)/ρ_i, dρ_i/dt = ξ̂ ε/c ΔP − ρ_i ∇·u
//!
//! The diffusion damps what the gradient does not see, as that of PCP eq. B.12 does, with ΔP = c² Δρ.

use super::flow_state::{FlowState, Rates};
use crate::geometry::{Domain, Vector};
use crate::neighbors::CellList;
use crate::operators::{Evaluation, FlatChart, Functional, Support, SupportDiagnostics};
use crate::parallel::{Interrupt, Interrupted};

/// Fits, the fields that they are made of and what they found.
pub(super) struct DcpseFlow<const D: usize> {
    support: Support,
    cells: CellList<D>,
    evaluation: Evaluation<D>,
    velocity: [Vec<f64>; D],
    /// For each particle ∂_a of the velocities and the pressure, axis by axis, then their Laplacians.
    found: Vec<f64>,
    /// Counts of fits that needed a rescue.
    pub fit_diagnostics: SupportDiagnostics,
}

/// Derivatives of the flow at a particle.
#[derive(Debug, Clone, Copy, PartialEq)]
struct FlowDerivatives<const D: usize> {
    pressure_gradient: Vector<D>,
    velocity_laplacian: Vector<D>,
    divergence: f64,
    pressure_laplacian: f64,
}

impl<const D: usize> DcpseFlow<D> {
    pub fn new(support: Support, domain: Domain<D>, count: usize) -> Self {
        let functionals: Vec<Functional<D>> =
            (0..D).map(Functional::Gradient).chain([Functional::LaplaceBeltrami]).collect();
        let evaluation = Evaluation::new(support, functionals);
        Self {
            support,
            cells: CellList::new(domain),
            found: vec![0.0; count * evaluation.numbers(D + 1)],
            evaluation,
            velocity: std::array::from_fn(|_| vec![0.0; count]),
            fit_diagnostics: SupportDiagnostics::default(),
        }
    }

    /// Sets accelerations and rates of density. `spread` is ξ̂ ε.
    pub fn find_rates(
        &mut self,
        positions: &[Vector<D>],
        flow: &FlowState<D>,
        spread: f64,
        rates: &mut Rates<D>,
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        self.find(positions, &flow.predicted, &flow.pressure, interrupt)?;
        for (i, acceleration) in rates.acceleration.iter_mut().enumerate() {
            let found = self.at(i);
            let (fluid, density) = (flow.fluid(i), flow.density[i]);
            *acceleration = (found.velocity_laplacian * fluid.viscosity - found.pressure_gradient) / density;
            let diffusion = spread / fluid.sound_speed * found.pressure_laplacian;
            rates.density[i] = diffusion - density * found.divergence;
        }
        Ok(())
    }

    /// Fits all derivatives at all particles.
    fn find(
        &mut self,
        positions: &[Vector<D>],
        velocity: &[Vector<D>],
        pressure: &[f64],
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        self.cells.rebuild(positions.iter().copied(), self.support.radius);
        for (d, column) in self.velocity.iter_mut().enumerate() {
            column.iter_mut().zip(velocity).for_each(|(c, u)| *c = u[d]);
        }
        let chart = FlatChart::new(positions, &self.cells);
        let mut fields: [&[f64]; 4] = [pressure; 4];
        for (field, column) in fields.iter_mut().zip(&self.velocity) {
            *field = column;
        }
        let found = self.evaluation.evaluate(&chart, &fields[..=D], &mut self.found, interrupt)?;
        self.fit_diagnostics.add(&found);
        Ok(())
    }

    /// The derivatives at a particle.
    fn at(&self, i: usize) -> FlowDerivatives<D> {
        let numbers = self.evaluation.numbers(D + 1);
        let own = &self.found[i * numbers..(i + 1) * numbers];
        let derivative = |functional: usize, field: usize| own[functional * (D + 1) + field];
        FlowDerivatives {
            pressure_gradient: Vector::<D>::from_fn(|a, _| derivative(a, D)),
            velocity_laplacian: Vector::<D>::from_fn(|d, _| derivative(D, d)),
            divergence: (0..D).map(|a| derivative(a, a)).sum(),
            pressure_laplacian: derivative(D, D),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{DcpseFlow, Support, Vector};
    use crate::geometry::Domain;
    use crate::geometry::domain::Axis;
    use crate::parallel::Interrupt;
    use std::f64::consts::TAU;

    #[test]
    fn derivatives_of_a_wave_are_found_across_the_edge_too() {
        let n = 24;
        let h = 1.0 / f64::from(n);
        let points: Vec<_> = (0..n * n).map(|k| Vector::<2>::new(f64::from(k % n) * h, f64::from(k / n) * h)).collect();
        let domain = Domain::new([Axis::Periodic { start: 0.0, length: 1.0 }; 2]);
        let mut flow = DcpseFlow::<2>::new(Support { degree: 3, radius: 3.0 * h }, domain, points.len());
        let velocity: Vec<_> =
            points.iter().map(|x| Vector::<2>::new((TAU * x[0]).sin(), (TAU * x[0]).cos())).collect();
        let pressure: Vec<f64> = points.iter().map(|x| (TAU * x[1]).sin()).collect();
        flow.find(&points, &velocity, &pressure, &Interrupt::default()).unwrap();
        for (i, x) in points.iter().enumerate() {
            let found = flow.at(i);
            assert!((found.pressure_gradient[1] - TAU * (TAU * x[1]).cos()).abs() < 0.03 * TAU);
            assert!(found.pressure_gradient[0].abs() < 1e-9);
            assert!((found.divergence - TAU * (TAU * x[0]).cos()).abs() < 0.03 * TAU);
            assert!((found.velocity_laplacian[0] + TAU * TAU * (TAU * x[0]).sin()).abs() < 0.05 * TAU * TAU);
        }
    }
}
