//! Sums over pairs against loops over all pairs, written as the paper writes them.

use super::hydrodynamics::Hydrodynamics;
use super::kernel_choice::KernelChoice;
use super::parts::{DensityMethod, Discretization, Geometry, Integrator, SphParts, TensionForce};
use super::{Fluid, time_step::longest_step};
use crate::geometry::domain::Axis;
use crate::geometry::random::CounterRandom;
use crate::geometry::{Domain, Vector};
use crate::parallel::Interrupt;

const KERNELS: [KernelChoice; 4] =
    [KernelChoice::WendlandC2, KernelChoice::WendlandC4, KernelChoice::CubicSpline, KernelChoice::QuinticSpline];

struct Setting<const D: usize> {
    parts: SphParts<D>,
    domain: Domain<D>,
    cell: f64,
    positions: Vec<Vector<D>>,
    velocity: Vec<Vector<D>>,
    is_inside: Vec<u8>,
}

fn setting<const D: usize>(kernel: KernelChoice, ratio: f64) -> Setting<D> {
    let (side, h) = (if D == 2 { 26_usize } else { 15 }, 0.1);
    let fluid = |density, viscosity| Fluid { density, viscosity, sound_speed: 20.0, polytropic: 7.0 };
    let parts = SphParts {
        spacing: h,
        smoothing_length: if D == 2 { 2.0 * h } else { 1.3 * h },
        kernel,
        inside: fluid(ratio, 0.4 * ratio),
        outside: fluid(1.0, 0.4),
        tension: 1.0,
        tension_force: TensionForce::Csf,
        geometry: Geometry::ColorField,
        discretization: Discretization::Kernels,
        density: DensityMethod::Summation,
        is_shifted: false,
        body_force: None,
        integrator: Integrator::KickDriftKick,
        is_adaptive: true,
        rest_below: None,
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
    let is_inside = positions.iter().map(|x| u8::from(x[0] < 0.3)).collect();
    Setting { parts, domain, cell: h.powi(D as i32), positions, velocity, is_inside }
}

impl<const D: usize> Setting<D> {
    fn gathered(&self) -> Hydrodynamics<D> {
        let mut sums = Hydrodynamics::new(&self.parts, &self.domain, self.cell).unwrap();
        sums.list(&self.positions, &Interrupt::default()).unwrap();
        sums.take_positions(&self.positions, &self.positions);
        sums
    }

    fn w(&self, r: f64) -> f64 {
        let e = self.parts.smoothing_length;
        self.parts.kernel.normalization(D) / e.powi(D as i32) * self.parts.kernel.value(r / e)
    }

    /// ∂W/∂r by a central difference of the value.
    fn slope(&self, r: f64) -> f64 {
        let step = 1e-6 * self.parts.smoothing_length;
        (self.w(r + step) - self.w((r - step).abs())) / (2.0 * step)
    }

    /// Calls with every other particle j in reach: x_i − x_j and its length.
    fn each(&self, i: usize, mut visit: impl FnMut(usize, Vector<D>, f64)) {
        for (j, x) in self.positions.iter().enumerate() {
            let dx = self.domain.displacement(x, &self.positions[i]);
            let r = dx.norm();
            if j != i && r < self.parts.kernel.support() * self.parts.smoothing_length {
                visit(j, dx, r);
            }
        }
    }

    fn volumes(&self, sums: &mut Hydrodynamics<D>) -> Vec<f64> {
        let mut volume = vec![0.0; self.positions.len()];
        sums.volumes(&mut volume, &Interrupt::default()).unwrap();
        volume
    }

    fn mass(&self, i: usize) -> f64 {
        self.parts.fluid(self.is_inside[i] == 1).density * self.cell
    }

    fn probes(&self) -> impl Iterator<Item = usize> {
        (0..self.positions.len()).step_by(37)
    }
}

/// Slopes are differences of values, and the mean pressure is a series: neither is exact beyond these digits.
fn near(got: f64, expected: f64, scale: f64, what: &str) {
    assert!((got - expected).abs() <= 2e-6 * scale, "{what}: {got} is not {expected}");
}

fn check_volume_form<const D: usize>(kernel: KernelChoice, ratio: f64) {
    let this = setting::<D>(kernel, ratio);
    let mut sums = this.gathered();
    let volume = this.volumes(&mut sums);
    let density: Vec<f64> = volume.iter().enumerate().map(|(i, v)| this.mass(i) / v).collect();
    let pressure: Vec<f64> =
        density.iter().zip(&this.is_inside).map(|(d, p)| this.parts.fluid(*p == 1).pressure(*d)).collect();
    let own = |i: usize| this.parts.fluid(this.is_inside[i] == 1).viscosity;
    let mut forces = vec![Vector::<D>::zeros(); volume.len()];
    let never = Interrupt::default();
    sums.forces(&this.parts, &this.is_inside, &volume, &pressure, &this.velocity, &mut forces, &never).unwrap();
    for i in this.probes() {
        let mut number = this.w(0.0);
        let mut force = Vector::<D>::zeros();
        let mut scale = 0.0;
        this.each(i, |j, dx, r| {
            number += this.w(r);
            let squares = volume[i] * volume[i] + volume[j] * volume[j];
            // By volumes; of one mass, as the paper has it, by densities.
            let mean = (volume[i] * pressure[i] + volume[j] * pressure[j]) / (volume[i] + volume[j]);
            if ratio == 1.0 {
                let papers = (density[i] * pressure[j] + density[j] * pressure[i]) / (density[i] + density[j]);
                near(mean, papers, 1.0, "mean pressure");
            }
            let eta = 2.0 * own(i) * own(j) / (own(i) + own(j));
            let slope = this.slope(r);
            let along = dx * (-squares * mean * slope / r);
            force += along + (this.velocity[i] - this.velocity[j]) * (eta * squares * slope / r);
            scale += along.norm();
        });
        near(volume[i], 1.0 / number, volume[i], "volume");
        for d in 0..D {
            near(forces[i][d], force[d], scale.max(1.0), "force");
        }
    }
    let all: Vector<D> = forces.iter().sum();
    let norms: f64 = forces.iter().map(Vector::<D>::norm).sum();
    assert!(all.norm() < 1e-14 * norms, "{} of {norms}", all.norm());
}

#[test]
fn volume_forms_are_those_of_the_paper_and_keep_momentum() {
    for kernel in KERNELS {
        check_volume_form::<2>(kernel, 1.0);
        check_volume_form::<2>(kernel, 10.0);
    }
    check_volume_form::<3>(KernelChoice::WendlandC2, 1.0);
    check_volume_form::<3>(KernelChoice::CubicSpline, 3.0);
}

fn check_mass_form<const D: usize>(ratio: f64) {
    let mut this = setting::<D>(KernelChoice::WendlandC2, ratio);
    this.parts.density = DensityMethod::Continuity { diffusion: 0.05 };
    let random = CounterRandom::new(8);
    let count = this.positions.len();
    let density: Vec<f64> = (0..count)
        .map(|i| this.parts.fluid(this.is_inside[i] == 1).density * (1.0 + 0.05 * random.symmetric(&[i as i64])))
        .collect();
    let pressure: Vec<f64> =
        density.iter().zip(&this.is_inside).map(|(d, p)| this.parts.fluid(*p == 1).pressure(*d)).collect();
    let (mut acceleration, mut rate) = (vec![Vector::<D>::zeros(); count], vec![0.0; count]);
    let mut sums = this.gathered();
    sums.rates(
        &this.parts,
        0.05,
        &this.is_inside,
        |i| this.mass(i),
        &density,
        &pressure,
        &this.velocity,
        &mut acceleration,
        &mut rate,
        &Interrupt::default(),
    )
    .unwrap();
    let (e, factor) = (this.parts.smoothing_length, if D == 2 { 8.0 } else { 10.0 });
    let fluid = |i: usize| this.parts.fluid(this.is_inside[i] == 1);
    for i in this.probes() {
        let (mut a, mut expected, mut scale) = (Vector::<D>::zeros(), 0.0, 0.0);
        this.each(i, |j, dx, r| {
            let grad = dx * (this.slope(r) / r);
            let u = this.velocity[i] - this.velocity[j];
            let (nu_i, nu_j) = (fluid(i).kinematic_viscosity(), fluid(j).kinematic_viscosity());
            let nu = factor * 2.0 * nu_i * nu_j / (nu_i + nu_j);
            let pi = -nu / (0.5 * (density[i] + density[j])) * u.dot(&dx) / (r * r + 0.01 * e * e);
            let part = pressure[i] / density[i].powi(2) + pressure[j] / density[j].powi(2) + pi;
            a -= grad * (this.mass(j) * part);
            let volume = this.mass(j) / density[j];
            let excess = (density[i] / fluid(i).density - density[j] / fluid(j).density) * fluid(i).density;
            expected += density[i] * u.dot(&grad) * volume;
            let spread = 0.05 * e * fluid(i).sound_speed * 2.0 * excess * dx.dot(&grad) / (r * r) * volume;
            expected += spread;
            scale += spread.abs() + (grad * (this.mass(j) * part)).norm();
        });
        near(rate[i], expected, scale, "rate of density");
        for d in 0..D {
            near(acceleration[i][d], a[d], scale, "acceleration");
        }
    }
}

#[test]
fn mass_forms_are_those_of_the_paper() {
    check_mass_form::<2>(1.0);
    check_mass_form::<2>(10.0);
    check_mass_form::<3>(1.0);
}

#[test]
fn concentrations_push_from_the_crowded_to_the_empty() {
    let this = setting::<2>(KernelChoice::WendlandC2, 1.0);
    let mut sums = this.gathered();
    let volume = this.volumes(&mut sums);
    let mut gradients = vec![Vector::<2>::zeros(); volume.len()];
    sums.concentration(|i| volume[i], this.parts.spacing, &Interrupt::default(), |i, g| gradients[i] = g).unwrap();
    for i in this.probes() {
        let mut expected = Vector::<2>::zeros();
        this.each(i, |j, dx, r| {
            let weight = 1.0 + 0.2 * (this.w(r) / this.w(this.parts.spacing)).powi(4);
            expected += dx * (weight * this.slope(r) / r * volume[j]);
        });
        assert!((gradients[i] - expected).norm() < 1e-6 * (1.0 + expected.norm()));
    }
    let far = super::shifting::displacement(Vector::<2>::new(100.0, 0.0), 0.2);
    assert!((far + Vector::<2>::new(0.004, 0.0)).norm() < 1e-15, "at most 0.02 ε, against the gradient");
}

#[test]
fn the_colour_field_of_a_disk_has_outward_normals_and_its_curvature() {
    let mut this = setting::<2>(KernelChoice::WendlandC2, 1.0);
    let centre = Vector::<2>::new(0.6, 0.6);
    let radius = 0.8;
    let away: Vec<Vector<2>> = this.positions.iter().map(|x| this.domain.displacement(&centre, x)).collect();
    this.is_inside = away.iter().map(|dx| u8::from(dx.norm() < radius)).collect();
    let mut sums = this.gathered();
    let volume = this.volumes(&mut sums);
    let count = volume.len();
    let (mut gradient, mut normal) = (vec![Vector::<2>::zeros(); count], vec![Vector::<2>::zeros(); count]);
    let mut curvature = vec![0.0; count];
    sums.color_geometry(&this.is_inside, &volume, &mut gradient, &mut normal, &mut curvature, &Interrupt::default())
        .unwrap();
    // At the interface itself: outward, and the curvature of the circle within its known scatter.
    let at: Vec<usize> = (0..count).filter(|i| (away[*i].norm() - radius).abs() < 0.5 * this.parts.spacing).collect();
    let mean = at.iter().map(|i| curvature[*i]).sum::<f64>() / at.len() as f64;
    assert!(at.iter().all(|i| normal[*i].dot(&away[*i].normalize()) > 0.9));
    assert!((mean * radius - 1.0).abs() < 0.15, "{mean}");
    // The jump of the colour across the interface is one.
    let row: f64 = (0..count).map(|i| gradient[i].norm() * volume[i]).sum();
    assert!((row / (2.0 * std::f64::consts::PI * radius) - 1.0).abs() < 0.05, "{row}");
}

#[test]
fn limits_are_those_of_the_papers_and_the_measured_ones() {
    let mut this = setting::<2>(KernelChoice::WendlandC2, 1.0).parts;
    this.tension = 0.0;
    let e = this.smoothing_length;
    assert!((longest_step(&this, 3.0).0 - (0.4 * e / 23.0).min(0.06 * e * e / 0.4)).abs() < 1e-15);
    this.integrator = Integrator::PredictorCorrector;
    this.outside.viscosity = 1e-6;
    this.inside.viscosity = 1e-6;
    assert!((longest_step(&this, 3.0).0 - 0.25 * e / 23.0).abs() < 1e-15);
    this.tension = 1e6;
    assert_eq!(longest_step(&this, 3.0).1, "capillary waves");
}
