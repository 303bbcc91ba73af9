//! A box of two fluids with irregular particles, and loops over all pairs: the oracle of the interactions' tests.

use super::flow_state::FlowState;
use super::interactions::TensionForce;
use super::kernel_choice::{KernelChoice, ScaledKernel};
use super::neighbor_lists::NeighborLists;
use super::pair_workspace::PairWorkspace;
use super::{DensityMethod, Discretization, Drop, Fluid, Fluids, Geometry, Integrator, PressureConfig, SphConfig};
use crate::geometry::domain::Axis;
use crate::geometry::random::CounterRandom;
use crate::geometry::{Domain, Vector};
use crate::parallel::Interrupt;

pub(super) const KERNELS: [KernelChoice; 4] =
    [KernelChoice::WendlandC2, KernelChoice::WendlandC4, KernelChoice::CubicSpline, KernelChoice::QuinticSpline];

pub(super) struct Setting<const D: usize> {
    pub config: SphConfig<D>,
    pub domain: Domain<D>,
    pub cell: f64,
    pub positions: Vec<Vector<D>>,
    pub velocity: Vec<Vector<D>>,
    /// Signed distances from the interface, a plane.
    pub level: Vec<f64>,
}

/// A periodic box; densities and viscosities of the two fluids have the given ratio.
pub(super) fn setting<const D: usize>(kernel: KernelChoice, ratio: f64) -> Setting<D> {
    let (side, h) = (if D == 2 { 26_usize } else { 15 }, 0.1);
    let fluid = |density, viscosity| Fluid { density, viscosity, sound_speed: 20.0, polytropic: 7.0 };
    let config = SphConfig {
        spacing: h,
        smoothing_length: if D == 2 { 2.0 * h } else { 1.3 * h },
        kernel,
        fluids: Fluids { inside: fluid(ratio, 0.4 * ratio), outside: fluid(1.0, 0.4) },
        tension: 1.0,
        tension_force: TensionForce::Csf,
        tension_law: None,
        geometry: Geometry::ColorField,
        discretization: Discretization::Kernels,
        density: DensityMethod::Summation,
        pressure: PressureConfig::PAPER,
        is_shifted: false,
        shifting_rate: 0.05,
        body_force: None,
        is_at_rest: true,
        integrator: Integrator::KickDriftKick,
        start_velocity: Vector::<D>::zeros(),
        wave: None,
        expected_speed: 3.0,
        is_adaptive: true,
        rest_below: None,
        mean_shear: None,
        container: None,
        starts_in_layers: false,
        steady_flow: None,
        hydrostatic_pressure: 0.0,
    };
    let length = side as f64 * h;
    let domain = Domain::new([Axis::Periodic { start: -0.7, length }; D]);
    let random = CounterRandom::new(3);
    let place = |i: usize| {
        Vector::<D>::from_fn(|d, _| {
            let node = (i / side.pow(d as u32) % side) as f64 + 0.5;
            -0.7 + (node + 0.3 * random.symmetric(&[i as i64, d as i64])) * h
        })
    };
    let count = side.pow(D as u32);
    let positions: Vec<Vector<D>> = (0..count).map(|i| domain.wrap(place(i))).collect();
    let velocity =
        (0..count).map(|i| Vector::<D>::from_fn(|d, _| random.symmetric(&[i as i64, d as i64, 5]))).collect();
    let level = positions.iter().map(|x| x[0] - 0.3).collect();
    Setting { config, domain, cell: h.powi(D as i32), positions, velocity, level }
}

impl<const D: usize> Setting<D> {
    /// The particles as a drop of a measure.
    pub fn drop(&self, measure: f64) -> Drop<D> {
        let (positions, level) = (self.positions.clone(), self.level.clone());
        Drop { positions, level, velocities: None, measure, behind_walls: Vec::new() }
    }

    pub fn lists(&self) -> NeighborLists<D> {
        let (cutoff, skin) = (self.config.cutoff(), self.config.skin());
        NeighborLists::new(&self.domain, (cutoff, skin), self.positions.len(), std::iter::empty()).unwrap()
    }

    /// Positions listed and gathered.
    pub fn gathered(&self) -> PairWorkspace<D> {
        let kernel = ScaledKernel::new(self.config.kernel, self.config.smoothing_length, D);
        let mut pairs = PairWorkspace::new(self.lists(), kernel, self.cell, Interrupt::default());
        pairs.list(&self.positions).unwrap();
        pairs.gather_positions(&self.positions);
        pairs
    }

    pub fn flow(&self) -> FlowState<D> {
        let mut flow = FlowState::in_motion(
            self.config.fluids,
            self.cell,
            &self.level,
            vec![Vector::<D>::zeros(); self.level.len()],
        );
        flow.velocity.clone_from(&self.velocity);
        flow.predicted.clone_from(&self.velocity);
        flow
    }

    pub fn w(&self, r: f64) -> f64 {
        let kernel = ScaledKernel::new(self.config.kernel, self.config.smoothing_length, D);
        kernel.normalization * kernel.value(r / kernel.smoothing_length)
    }

    /// ∂W/∂r by a central difference of the value.
    pub fn slope(&self, r: f64) -> f64 {
        let step = 1e-6 * self.config.smoothing_length;
        (self.w(r + step) - self.w((r - step).abs())) / (2.0 * step)
    }

    /// Calls with every other particle j within the support of the kernel: x_i − x_j and its length.
    pub fn each(&self, i: usize, mut visit: impl FnMut(usize, Vector<D>, f64)) {
        for (j, x) in self.positions.iter().enumerate() {
            let dx = self.domain.displacement(x, &self.positions[i]);
            let r = dx.norm();
            if j != i && r < self.config.kernel.support() * self.config.smoothing_length {
                visit(j, dx, r);
            }
        }
    }

    pub fn probes(&self) -> impl Iterator<Item = usize> {
        (0..self.positions.len()).step_by(37)
    }
}

/// Slopes are differences of values, and the mean pressure is a series: neither is exact beyond these digits.
pub(super) fn near(got: f64, expected: f64, scale: f64, what: &str) {
    assert!((got - expected).abs() <= 2e-6 * scale, "{what}: {got} is not {expected}");
}
