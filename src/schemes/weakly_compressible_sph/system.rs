//! The particles of two fluids and everything that is found at a moment: one evaluation from positions to accelerations.

use super::components::{Components, FRAGMENT, ball_curvature};
use super::dcpse::DcpseFlow;
use super::hydrodynamics::Hydrodynamics;
use super::interface::Interface;
use super::parts::{DensityMethod, Discretization, Geometry, Integrator, SphParts, TensionForce};
use super::shifting::{displacement, part_along};
use super::stepping::Start;
use super::strays::Strays;
use crate::closest_point::SurfaceColumns;
use crate::geometry::{Domain, Vector};
use crate::neighbors::pencils::BoxTooSmall;
use crate::parallel::{Interrupt, Interrupted};
use crate::particles::Particles;
use crate::simulation::Phases;

/// Particles at time 0.
#[derive(Debug, Clone)]
pub struct Drop<const D: usize> {
    /// Where they are, in the box.
    pub positions: Vec<Vector<D>>,
    /// Signed distance from the interface; its sign is the phase.
    pub level: Vec<f64>,
    /// The enclosed measure, where it is known.
    pub measure: f64,
}

/// Two fluids.
pub struct SphSystem<const D: usize> {
    pub(super) parts: SphParts<D>,
    pub(super) domain: Domain<D>,
    /// The volume of a particle at rest.
    pub(super) cell: f64,
    /// Positions, and what is known of the interface; φ is the level that particles carry.
    pub(super) particles: Particles<D>,
    pub(super) columns: SurfaceColumns,
    pub(super) velocity: Vec<Vector<D>>,
    pub(super) acceleration: Vec<Vector<D>>,
    pub(super) density: Vec<f64>,
    /// Of continuity alone.
    pub(super) density_rate: Vec<f64>,
    /// Where everybody was when neighbours were listed.
    pub(super) reference: Vec<Vector<D>>,
    /// 1 inside.
    pub(super) phase: Vec<u8>,
    /// 1 near the interface.
    pub(super) candidate: Vec<u8>,
    /// Whose κ₀ a particle takes, where there are several droplets.
    pub(super) droplet: Vec<u8>,
    /// κ₀ of each droplet.
    pub(super) ball_curvatures: Vec<f64>,
    /// Particles of each droplet when they were last counted anew.
    sizes: Vec<usize>,
    /// The measure that was enclosed at the start.
    pub(super) initial_measure: f64,
    pub(super) hydrodynamics: Hydrodynamics<D>,
    pub(super) interface: Option<Interface<D>>,
    pub(super) dcpse: Option<DcpseFlow<D>>,
    components: Components<D>,
    pub(super) strays: Strays<D>,
    volume: Vec<f64>,
    pub(super) pressure: Vec<f64>,
    /// n̂ of a colour field, with its unit normals and curvatures.
    gradient: Vec<Vector<D>>,
    normal: Vec<Vector<D>>,
    curvature: Vec<f64>,
    /// Velocities that viscosity reckons with.
    pub(super) predicted: Vec<Vector<D>>,
    /// What the present step started from.
    pub(super) start: Start<D>,
    pub(super) interrupt: Interrupt,
}

/// What kept an evaluation from its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum EvaluationError {
    Interrupted,
    InterfaceLost,
}

impl From<Interrupted> for EvaluationError {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

impl<const D: usize> SphSystem<D> {
    /// Fluids at rest. `cell` is the volume of a particle.
    ///
    /// # Errors
    /// [`BoxTooSmall`].
    pub fn new(
        parts: SphParts<D>,
        domain: Domain<D>,
        cell: f64,
        drop: Drop<D>,
        interrupt: Interrupt,
    ) -> Result<Self, BoxTooSmall> {
        let hydrodynamics = Hydrodynamics::new(&parts, &domain, cell)?;
        let count = drop.positions.len();
        let mut particles = Particles::new(drop.positions);
        let columns = SurfaceColumns::add(&mut particles);
        particles.scalar_mut(columns.phi).copy_from_slice(&drop.level);
        let interface = match &parts.geometry {
            Geometry::Pcp { method, half_band } if parts.has_tension() => {
                Some(Interface::new(method.clone(), &domain, parts.spacing, *half_band))
            }
            _ => None,
        };
        let zeros = || vec![Vector::<D>::zeros(); count];
        let colors = if parts.geometry == Geometry::ColorField && parts.has_tension() { count } else { 0 };
        let is_integrated = parts.density != DensityMethod::Summation;
        Ok(Self {
            columns,
            velocity: zeros(),
            acceleration: zeros(),
            density: drop.level.iter().map(|level| parts.fluid(*level < 0.0).density).collect(),
            density_rate: vec![0.0; if is_integrated { count } else { 0 }],
            reference: zeros(),
            phase: drop.level.iter().map(|level| u8::from(*level < 0.0)).collect(),
            candidate: vec![0; count],
            droplet: vec![FRAGMENT; count],
            ball_curvatures: Vec::new(),
            sizes: Vec::new(),
            initial_measure: drop.measure,
            components: Components::new(domain.clone()),
            strays: Strays::new(domain.clone()),
            hydrodynamics,
            interface,
            dcpse: match parts.discretization {
                Discretization::Kernels => None,
                Discretization::Dcpse(support) => Some(DcpseFlow::new(support, domain.clone(), count)),
            },
            volume: vec![cell; count],
            pressure: vec![0.0; count],
            gradient: vec![Vector::<D>::zeros(); colors],
            normal: vec![Vector::<D>::zeros(); colors],
            curvature: vec![0.0; colors],
            predicted: zeros(),
            start: Start {
                positions: room(count, parts.integrator),
                velocity: room(count, parts.integrator),
                density: Vec::new(),
            },
            particles,
            parts,
            domain,
            cell,
            interrupt,
        })
    }

    /// The mass of a particle.
    pub(super) fn mass(&self, i: usize) -> f64 {
        self.parts.fluid(self.phase[i] == 1).density * self.cell
    }

    /// One evaluation: from positions, and the velocities in `predicted`, to accelerations. Returns how many droplets there
    /// are where that changed.
    ///
    /// 1. Neighbours, listed anew where somebody has moved too far.
    /// 2. Fits about the interface; particles shifted where the scene says so; closest points where they are then.
    /// 3. Volumes or densities, pressures.
    /// 4. Forces between particles, surface tension, force from outside.
    pub(super) fn evaluate(
        &mut self,
        time: f64,
        may_shift: bool,
        phases: &mut Phases,
    ) -> Result<Option<usize>, EvaluationError> {
        let is_listed = self.list_where_stale(phases)?;
        phases.measure("sph/gather", || self.gather_positions());
        if let Some(interface) = &mut self.interface {
            interface.rebuild(&self.particles, &self.columns, &self.interrupt, phases)?;
            if interface.surface.is_lost() {
                return Err(EvaluationError::InterfaceLost);
            }
        }
        if self.parts.is_shifted && may_shift {
            phases.measure("sph/shifting", || self.shift())?;
        }
        if let Some(interface) = &mut self.interface {
            let (particles, candidate) = (&mut self.particles, &mut self.candidate);
            interface.answer(particles, &self.columns, candidate, is_listed, &self.interrupt, phases)?;
        }
        let is_due = is_listed && self.parts.has_tension();
        let changed = if is_due { phases.measure("droplets", || self.count_droplets()) } else { None };
        if self.parts.density == DensityMethod::Summation {
            phases.measure("sph/density", || self.sum_densities())?;
        } else {
            self.derive_volumes();
        }
        self.derive_pressures();
        if !self.gradient.is_empty() {
            phases.measure("sph/color", || self.take_color_geometry())?;
        }
        phases.measure("sph/momentum", || self.sum_accelerations())?;
        phases.measure("sph/tension", || {
            self.add_tension();
            self.add_body_force(time);
        });
        Ok(changed)
    }

    fn list_where_stale(&mut self, phases: &mut Phases) -> Result<bool, Interrupted> {
        let positions = self.particles.positions();
        let is_stale = !self.hydrodynamics.is_listed() || self.hydrodynamics.is_stale(positions, &self.reference);
        if is_stale {
            self.reference.copy_from_slice(positions);
            phases.measure("neighbors", || self.hydrodynamics.list(&self.reference, &self.interrupt))?;
            let Self { interface, candidate, particles, columns, phase, strays, parts, .. } = self;
            if let Some(interface) = interface {
                phases.measure("redistancing/detection", || interface.select(particles, columns, candidate));
                if parts.is_shifted && parts.inside == parts.outside {
                    phases.measure("droplets", || {
                        strays.absorb(particles, columns.phi, interface.candidates(), parts.spacing, phase);
                    });
                }
            }
        }
        Ok(is_stale)
    }

    /// Everything that is derived from columns and not found again at every evaluation.
    pub(super) fn derive(&mut self) -> Result<(), Interrupted> {
        self.hydrodynamics.list(&self.reference, &self.interrupt)?;
        if let Some(interface) = &mut self.interface {
            interface.take(&self.candidate);
        }
        self.derive_pressures();
        Ok(())
    }

    /// The volumes of the present densities: what a state needs not hold.
    fn derive_volumes(&mut self) {
        for i in 0..self.volume.len() {
            self.volume[i] = self.mass(i) / self.density[i];
        }
    }

    fn gather_positions(&mut self) {
        self.hydrodynamics.take_positions(self.particles.positions(), &self.reference);
    }

    /// Moves particles towards evenness (B.16), those at the interface along it, so that it stays where it is and nobody
    /// changes side.
    fn shift(&mut self) -> Result<(), Interrupted> {
        self.derive_volumes();
        let Self { hydrodynamics, particles, columns, interface, parts, volume, domain, interrupt, .. } = self;
        let has_interface = interface.is_some();
        hydrodynamics.concentration(
            |i| volume[i],
            parts.spacing,
            interrupt,
            |i, gradient| {
                let mut shift = displacement(gradient, parts.smoothing_length);
                if has_interface {
                    let (phi, normal) = (particles.scalar(columns.phi)[i], particles.vector(columns.normal)[i]);
                    shift -= normal * (normal.dot(&shift) * part_along(phi / parts.spacing));
                }
                let x = &mut particles.positions_mut()[i];
                *x = domain.wrap(*x + shift);
            },
        )?;
        self.gather_positions();
        Ok(())
    }

    fn sum_densities(&mut self) -> Result<(), Interrupted> {
        self.hydrodynamics.volumes(&mut self.volume, &self.interrupt)?;
        for i in 0..self.volume.len() {
            self.density[i] = self.mass(i) / self.volume[i];
        }
        Ok(())
    }

    /// Pressures of the present densities.
    pub(super) fn derive_pressures(&mut self) {
        let states = self.pressure.iter_mut().zip(&self.density).zip(&self.phase);
        for ((pressure, density), phase) in states {
            *pressure = self.parts.fluid(*phase == 1).pressure(*density);
        }
    }

    fn take_color_geometry(&mut self) -> Result<(), Interrupted> {
        let Self { hydrodynamics, phase, volume, gradient, normal, curvature, interrupt, .. } = self;
        hydrodynamics.color_geometry(phase, volume, gradient, normal, curvature, interrupt)?;
        let band = self.particles.flag_mut(self.columns.in_band);
        for (band, normal) in band.iter_mut().zip(&self.normal) {
            *band = u8::from(normal.norm_squared() > 0.0);
        }
        self.particles.vector_mut(self.columns.normal).copy_from_slice(&self.normal);
        self.particles.scalar_mut(self.columns.curvature).copy_from_slice(&self.curvature);
        Ok(())
    }

    /// −∇p/ρ + (η/ρ) Δu, and −ρ ∇·u + ξ̂ ε c Δρ with Δp = c² Δρ, which damps what the gradient does not see (as B.12 does).
    fn fit_accelerations(&mut self) -> Result<(), Interrupted> {
        let Self { dcpse: Some(flow), particles, predicted, pressure, density, phase, parts, .. } = self else {
            return Ok(());
        };
        let diffusion = if let DensityMethod::Continuity { diffusion } = parts.density { diffusion } else { 0.0 };
        flow.find(particles.positions(), predicted, pressure, &self.interrupt)?;
        for (i, acceleration) in self.acceleration.iter_mut().enumerate() {
            let found = flow.at(i);
            let fluid = parts.fluid(phase[i] == 1);
            *acceleration = (found.velocity_laplacian * fluid.viscosity - found.pressure_gradient) / density[i];
            let spread = diffusion * parts.smoothing_length / fluid.sound_speed * found.pressure_laplacian;
            self.density_rate[i] = spread - density[i] * found.divergence;
        }
        Ok(())
    }

    fn sum_accelerations(&mut self) -> Result<(), Interrupted> {
        if self.dcpse.is_some() {
            return self.fit_accelerations();
        }
        let Self { hydrodynamics, parts, volume, pressure, density, predicted, acceleration, interrupt, .. } = self;
        let (parts, phase, cell) = (&*parts, &self.phase, self.cell);
        let mass = |i: usize| parts.fluid(phase[i] == 1).density * cell;
        match parts.density {
            DensityMethod::Summation => {
                hydrodynamics.forces(parts, phase, volume, pressure, predicted, acceleration, interrupt)?;
                for (i, acceleration) in acceleration.iter_mut().enumerate() {
                    *acceleration /= mass(i);
                }
            }
            DensityMethod::Continuity { diffusion } => {
                let rates = &mut self.density_rate;
                hydrodynamics.rates(
                    parts,
                    diffusion,
                    phase,
                    mass,
                    density,
                    pressure,
                    predicted,
                    acceleration,
                    rates,
                    interrupt,
                )?;
            }
        }
        Ok(())
    }

    /// κ₀ of the droplet that a particle belongs to.
    pub(super) fn ball_curvature(&self, i: usize) -> f64 {
        match self.ball_curvatures.as_slice() {
            [only] => *only,
            several => several.get(self.droplet[i] as usize).copied().unwrap_or(0.0),
        }
    }

    /// The part of the pressure that the balanced force has absorbed: τκ₀ inside.
    pub(super) fn absorbed_pressure(&self, i: usize) -> f64 {
        if self.phase[i] == 1 && self.parts.has_tension() { self.parts.tension * self.absorbed(i) } else { 0.0 }
    }

    /// What is taken from the curvature before it becomes a force.
    fn absorbed(&self, i: usize) -> f64 {
        if self.parts.tension_force == TensionForce::Balanced { self.ball_curvature(i) } else { 0.0 }
    }

    /// −(τ/ρ) (κ − κ₀) n δ (B.4, B.10).
    fn add_tension(&mut self) {
        if let Some(interface) = &self.interface {
            let (phi, curvature) =
                (self.particles.scalar(self.columns.phi), self.particles.scalar(self.columns.curvature));
            let (normal, band) =
                (self.particles.vector(self.columns.normal), self.particles.flag(self.columns.in_band));
            for i in interface.candidates().iter().copied().filter(|i| band[*i] == 1) {
                let delta = smoothed_delta(phi[i], self.parts.smoothing_length);
                if delta > 0.0 {
                    let strength = -self.parts.tension / self.density[i] * (curvature[i] - self.absorbed(i)) * delta;
                    self.acceleration[i] += normal[i] * strength;
                }
            }
        }
        for i in 0..self.gradient.len() {
            let strength = -self.parts.tension / self.density[i] * (self.curvature[i] - self.absorbed(i));
            let force = self.gradient[i] * strength;
            self.acceleration[i] += force;
        }
    }

    fn add_body_force(&mut self, time: f64) {
        let Some(force) = &self.parts.body_force else { return };
        for ((acceleration, x), phase) in self.acceleration.iter_mut().zip(self.particles.positions()).zip(&self.phase)
        {
            *acceleration += force.acceleration(x, time, *phase == 1);
        }
    }

    /// Finds the droplets; where their number changed, each gets the curvature of a ball of its share of the measure that was
    /// enclosed at the start.
    fn count_droplets(&mut self) -> Option<usize> {
        let Self { components, particles, phase, droplet, parts, .. } = self;
        let reach = self.interface.as_ref().map_or(0.0, Interface::keep);
        let asked = self.interface.as_ref().map_or(&[][..], |interface| interface.candidates());
        let sizes = components.find(particles.positions(), phase, asked.iter().copied(), parts.spacing, reach, droplet);
        if sizes.len() == self.ball_curvatures.len() {
            return None;
        }
        self.sizes.clear();
        self.sizes.extend_from_slice(sizes);
        self.renew_ball_curvatures();
        Some(self.ball_curvatures.len())
    }

    /// κ₀ of each droplet for its share of the measure that was enclosed at the start.
    pub(super) fn renew_ball_curvatures(&mut self) {
        let all = self.sizes.iter().sum::<usize>().max(1) as f64;
        self.ball_curvatures.clear();
        let share = |size: &usize| ball_curvature::<D>(self.initial_measure * *size as f64 / all);
        self.ball_curvatures.extend(self.sizes.iter().map(share));
    }
}

/// Room for what only the predictor–corrector keeps.
fn room<const D: usize>(count: usize, integrator: Integrator) -> Vec<Vector<D>> {
    vec![Vector::<D>::zeros(); if integrator == Integrator::PredictorCorrector { count } else { 0 }]
}

/// δ of a signed distance: Wendland's C² kernel of one dimension (B.3), of support 2 ε.
pub(super) fn smoothed_delta(distance: f64, smoothing_length: f64) -> f64 {
    let q = distance.abs() / smoothing_length;
    let rest = (1.0 - 0.5 * q).max(0.0);
    0.625 / smoothing_length * rest * rest * rest * (1.5 * q + 1.0)
}

#[cfg(test)]
mod tests {
    use super::smoothed_delta;

    #[test]
    fn the_smoothed_delta_integrates_to_one() {
        let sum: f64 = (0..4000).map(|k| smoothed_delta(f64::from(k - 2000) * 1e-3 + 5e-4, 0.4) * 1e-3).sum();
        assert!((sum - 1.0).abs() < 1e-6, "{sum}");
    }
}
