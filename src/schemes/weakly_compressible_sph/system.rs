//! The particles of the fluids, and one evaluation: from positions to rates of change.

use super::config::{PressureConfig, SphConfig, Volumes};
use super::droplets::{Droplets, Searched};
use super::equations::FlowEquations;
use super::flow_state::{FlowState, Rates};
use super::interactions::contact_line::ContactLines;
use super::interactions::surface_tension::{BandForces, SurfaceTension};
use super::interactions::{Moment, ParticleForce, TensionForce, density_summation, shifting};
use super::interface::level_set::Answering;
use super::interface::{Interface, InterfaceError, LevelSet};
use super::kernel_choice::ScaledKernel;
use super::neighbor_lists::NeighborLists;
use super::pair_workspace::PairWorkspace;
use super::species::Species;
use super::start::{balance, new_interface, new_walls, start_velocities, stray_allowance};
use super::strays::Strays;
use super::surfactant::Scales;
use super::varying_tension::{Surroundings, VaryingTension};
use super::volume_form::viscosity_share;
use super::walls::Walls;
use super::walls::level::Levels;
use crate::closest_point::SurfaceColumns;
use crate::geometry::domain::Axis;
use crate::geometry::{Domain, Vector};
use crate::neighbors::pencils::BoxTooSmall;
use crate::parallel::{Interrupt, Interrupted};
use crate::particles::Particles;
use crate::simulation::Phases;

/// Particles at time 0.
#[derive(Debug, Clone)]
pub struct Drop<const D: usize> {
    /// Positions in the box.
    pub positions: Vec<Vector<D>>,
    /// Signed distances from the interface; their sign decides the species.
    pub level: Vec<f64>,
    /// Velocities about that of the start; None where the fluids are at rest.
    pub velocities: Option<Vec<Vector<D>>>,
    /// The enclosed area or volume; NaN where it is not known.
    pub measure: f64,
    /// Positions of the points behind walls.
    pub behind_walls: Vec<Vector<D>>,
}

/// Two fluids.
///
/// Within an evaluation data flows one way: positions → neighbor lists → interface → densities and pressures → rates.
pub struct SphSystem<const D: usize> {
    pub(super) config: SphConfig<D>,
    pub(super) domain: Domain<D>,
    /// Positions, and what particles know of the interface; φ is the level that they carry.
    pub(super) particles: Particles<D>,
    pub(super) columns: SurfaceColumns,
    pub(super) flow: FlowState<D>,
    pub(super) walls: Option<Walls<D>>,
    pub(super) pairs: PairWorkspace<D>,
    pub(super) interface: Interface<D>,
    pub(super) droplets: Droplets<D>,
    pub(super) strays: Strays<D>,
    pub(super) equations: FlowEquations<D>,
    tension: Option<SurfaceTension>,
    pub(super) varying: Option<VaryingTension<D>>,
    /// Accelerations by surface tension of the particles in the band, at the last evaluation.
    pub(super) band: BandForces<D>,
    /// Forces on particles, added in this order behind those of the band.
    forces: Vec<Box<dyn ParticleForce<D>>>,
    pub(super) contact_lines: Option<ContactLines<D>>,
    /// Accelerations of the particles next to contact lines, at the last evaluation.
    pub(super) line_forces: Vec<(usize, Vector<D>)>,
    pub(super) rates: Rates<D>,
    pub(super) interrupt: Interrupt,
}

/// Lengths and times by which a surfactant is exchanged.
fn scales<const D: usize>(config: &SphConfig<D>) -> Scales {
    let repair_time = config.repair_time();
    Scales { spacing: config.spacing, smoothing_length: config.smoothing_length, repair_time }
}

/// When an evaluation happens.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Instant {
    pub time: f64,
    /// Time since the last evaluation, 0 for the first.
    pub elapsed: f64,
    /// Whether particles may be shifted.
    pub may_shift: bool,
}

/// The reason why an evaluation did not end.
pub(super) type EvaluationError = InterfaceError;

impl<const D: usize> SphSystem<D> {
    /// Fluids at rest. `cell` is the volume of a particle.
    ///
    /// # Errors
    /// [`BoxTooSmall`].
    pub fn new(
        mut config: SphConfig<D>,
        domain: Domain<D>,
        cell: f64,
        drop: Drop<D>,
        interrupt: Interrupt,
    ) -> Result<Self, BoxTooSmall> {
        let count = drop.positions.len();
        let walls = new_walls(&config, &domain, &drop.behind_walls, cell);
        let fixed = walls.iter().flat_map(Walls::positions);
        let lists = NeighborLists::new(&domain, (config.cutoff(), config.skin()), count, fixed)?
            .in_shear(config.mean_shear, config.layer_thickness());
        config.body_force = config.body_force.take().map(|force| balance(force, &config.fluids, &drop.level));
        let kernel = ScaledKernel::new(config.kernel, config.smoothing_length, D);
        let mut particles = Particles::new(drop.positions);
        let columns = SurfaceColumns::add(&mut particles);
        particles.scalar_mut(columns.phi).copy_from_slice(&drop.level);
        let interface = new_interface(&config, &domain, &mut particles, &columns);
        let tension = config.has_tension().then(|| config.surface_tension());
        let law = config.tension_law.filter(|_| interface.level_set().is_some());
        let varying =
            law.map(|law| VaryingTension::new((law, config.tension), &domain, scales(&config), &mut particles));
        let contact_lines = tension
            .zip(config.container.clone())
            .map(|(tension, container)| ContactLines::new(container, tension, config.tension, config.smoothing_length));
        let mut forces: Vec<Box<dyn ParticleForce<D>>> = Vec::new();
        forces.extend(tension.map(|tension| Box::new(tension) as Box<dyn ParticleForce<D>>));
        forces.extend(config.body_force.clone().map(|force| Box::new(force) as Box<dyn ParticleForce<D>>));
        let mut system = Self {
            flow: FlowState::in_motion(
                config.fluids,
                cell,
                &drop.level,
                start_velocities(&config, &drop.velocities, count),
            ),
            walls,
            pairs: PairWorkspace::new(lists, kernel, cell, interrupt.clone()),
            interface,
            droplets: Droplets::new(domain.clone(), count, drop.measure),
            strays: Strays::new(domain.clone(), stray_allowance(&config, &drop.level)),
            equations: FlowEquations::new(&config, &domain, count),
            rates: Rates::none(count, config.is_density_integrated()),
            particles,
            columns,
            tension,
            varying,
            band: BandForces::default(),
            forces,
            contact_lines,
            line_forces: Vec::new(),
            config,
            domain,
            interrupt,
        };
        system.slide_images(0.0);
        Ok(system)
    }

    /// One evaluation: from positions, and the velocities in `predicted`, to rates. `elapsed` is the time since the last
    /// evaluation, 0 for the first. Returns the number of droplets where it changed.
    ///
    /// 1. Neighbors, listed anew where a particle has moved too far.
    /// 2. Fits around the interface; particles shifted where the scene says so; closest points at their new positions.
    /// 3. Volumes or densities, pressures.
    /// 4. Interactions between particles, then forces on particles.
    pub(super) fn evaluate(
        &mut self,
        Instant { time, elapsed, may_shift }: Instant,
        phases: &mut Phases,
    ) -> Result<Option<usize>, EvaluationError> {
        let is_listed = self.list_where_stale(phases)?;
        phases.measure("sph/gather", || self.pairs.gather_positions(self.particles.positions()));
        let changed = self.find_interface((is_listed, elapsed), may_shift, phases)?;
        if self.config.is_density_integrated() {
            self.flow.derive_volumes();
        } else {
            phases.measure("sph/density", || self.sum_densities())?;
        }
        self.flow.derive_pressures();
        let PressureConfig { bulk_damping, .. } = self.config.pressure;
        if bulk_damping > 0.0 && !self.config.is_density_integrated() {
            self.flow.damp_bulk(bulk_damping * self.config.smoothing_length, elapsed);
        }
        phases.measure("sph/tension", || self.advance_tension(elapsed))?;
        if let Interface::ColorField(color) = &mut self.interface {
            phases.measure("sph/color", || {
                let found = color.find(&self.flow, &mut self.pairs);
                color.store(&mut self.particles, &self.columns);
                found
            })?;
        }
        phases.measure("sph/momentum", || {
            let Self { equations, particles, flow, walls, pairs, rates, interrupt, config, .. } = self;
            if let Some(walls) = walls {
                walls.continue_flow(particles.positions(), flow, config.body_force.as_ref(), time);
            }
            equations.find_rates(particles.positions(), (flow, walls.as_mut()), pairs, rates, interrupt)
        })?;
        phases.measure("sph/tension", || self.add_forces(time));
        Ok(changed)
    }

    fn list_where_stale(&mut self, phases: &mut Phases) -> Result<bool, Interrupted> {
        let Self { pairs, walls, interface, particles, columns, strays, flow, config, .. } = self;
        if !pairs.lists.are_stale(particles.positions()) {
            return Ok(false);
        }
        phases.measure("neighbors", || {
            if let Some(walls) = walls {
                walls.list(particles.positions());
            }
            pairs.list(particles.positions())
        })?;
        if let Interface::LevelSet(level_set) = interface {
            phases.measure("redistancing/detection", || level_set.select(particles, columns));
            if config.is_shifted && config.fluids.are_equal() {
                let (levels, near) = ([columns.phi, level_set.carried()], level_set.candidates());
                phases.measure("droplets", || {
                    strays.absorb(particles, levels, near, config.spacing, &mut flow.species);
                });
            }
        }
        Ok(true)
    }

    /// The interface, with particles shifted between the fits and the closest points, and the count of droplets.
    fn find_interface(
        &mut self,
        (is_listed, elapsed): (bool, f64),
        may_shift: bool,
        phases: &mut Phases,
    ) -> Result<Option<usize>, EvaluationError> {
        if let Interface::LevelSet(level_set) = &mut self.interface {
            if let Some(walls) = &mut self.walls {
                let level = self.particles.scalar(level_set.carried());
                let (positions, reach) = (self.particles.positions(), level_set.keep());
                walls.extend_level(Levels { positions, level, reach });
            }
            let extension = self.walls.as_ref().map(|walls| &walls.extension);
            level_set.rebuild(&self.particles, &self.columns, extension, &self.interrupt, phases)?;
        }
        if self.config.is_shifted && may_shift {
            phases.measure("sph/shifting", || self.shift(elapsed))?;
        }
        if let Interface::LevelSet(level_set) = &mut self.interface {
            let answering = Answering { is_selection: is_listed, elapsed, droplets: &self.droplets };
            level_set.answer(&mut self.particles, &self.columns, answering, &self.interrupt, phases)?;
        }
        let is_due = is_listed && self.tension.is_some();
        Ok(if is_due { phases.measure("droplets", || self.count_droplets()) } else { None })
    }

    /// Sets what pressures are measured by: the volumes of the start fill the box, and the background pressure follows from the
    /// curvature κ₀ of the smallest droplet. A layer has none; 2 by the shortest side of the box stands for it.
    ///
    /// Between walls and in shear viscosities are calibrated, too: there friction decides the flow.
    ///
    /// Returns whether anything changed, so that the rates have to be found again.
    pub(super) fn calibrate(&mut self) -> Result<bool, Interrupted> {
        let PressureConfig { volumes, background, .. } = self.config.pressure;
        let has_background = background > 0.0 || self.config.hydrostatic_pressure > 0.0;
        if self.config.is_density_integrated() || (volumes == Volumes::Plain && !has_background) {
            return Ok(false);
        }
        if volumes == Volumes::Calibrated {
            let of_walls: &[f64] = self.walls.as_ref().map_or(&[], |walls| &walls.volume);
            let filled: f64 = self.flow.volume.iter().chain(of_walls).sum();
            self.flow.calibration *= self.flow.cell * (self.flow.count() + of_walls.len()) as f64 / filled;
            if self.walls.is_some() || self.config.mean_shear.is_some() {
                // Volumes scale with the calibration, and so does the share.
                self.sum_densities()?;
                let share = viscosity_share(&self.flow, self.walls.as_ref(), &mut self.pairs)?;
                self.flow.viscosity_factor = 1.0 / share;
            }
        }
        let sides = self.domain.axes().iter().map(|axis| match axis {
            Axis::Unbounded => f64::INFINITY,
            Axis::Periodic { length, .. } => *length,
        });
        let kappa = self.droplets.ball_curvatures.iter().copied().fold(0.0, f64::max);
        let kappa = if kappa > 0.0 { kappa } else { 2.0 / sides.fold(f64::INFINITY, f64::min) };
        self.flow.background = background * self.config.tension * kappa + self.config.hydrostatic_pressure;
        Ok(true)
    }

    /// Everything that is derived from columns and not found again at every evaluation, as a restart needs it.
    pub(super) fn derive(&mut self) -> Result<(), Interrupted> {
        self.pairs.list_reference()?;
        if let Some(walls) = &mut self.walls {
            walls.list(self.pairs.lists.reference());
        }
        if let Some(level_set) = self.interface.level_set_mut() {
            level_set.list_candidates();
        }
        self.flow.derive_pressures();
        let Self { varying, interface, particles, columns, flow, droplets, .. } = self;
        if let Some(varying) = varying {
            flow.derive_volumes();
            let surroundings = Surroundings { columns, flow, droplets, candidates: interface.candidates() };
            varying.derive(particles, surroundings);
        }
        Ok(())
    }

    /// Moves particles towards an even distribution (PCP eq. B.16). Particles at the interface are moved along it, so that it
    /// keeps its place and no particle changes side.
    ///
    /// With the balanced force no particle is shifted farther than the fastest has moved since the last evaluation: at rest,
    /// shifting stirs.
    fn shift(&mut self, elapsed: f64) -> Result<(), Interrupted> {
        let way = match self.config.tension_force {
            TensionForce::Balanced => self.flow.largest_speed() * elapsed,
            TensionForce::BalancedUncorrected | TensionForce::Csf => f64::INFINITY,
        };
        self.flow.derive_volumes();
        let Self { pairs, particles, columns, interface, config, flow, domain, .. } = self;
        let carried = interface.level_set().map(LevelSet::carried);
        // Points of walls have the volumes of the start: those of the last evaluation are in no checkpoint.
        let volume = |i: usize| flow.volume.get(i).copied().unwrap_or(flow.cell);
        shifting::concentration(pairs, volume, config.spacing, |i, gradient| {
            // Points of walls stay where they are.
            if i >= flow.count() {
                return;
            }
            let mut shift = shifting::displacement(gradient * config.shifting_rate, config.smoothing_length, way);
            if let Some(carried) = carried {
                let (phi, normal) = (particles.scalar(columns.phi)[i], particles.vector(columns.normal)[i]);
                shift -= normal * (normal.dot(&shift) * shifting::share_left_out(phi / config.spacing));
                if carried != columns.phi {
                    // The interface stays where it is: a particle takes the level of its new place.
                    particles.scalar_mut(carried)[i] += normal.dot(&shift);
                }
            }
            let x = &mut particles.positions_mut()[i];
            *x = domain.wrap(*x + shift);
        })?;
        pairs.gather_positions(particles.positions());
        Ok(())
    }

    /// Moves a surfactant on, and finds the tensions that vary.
    fn advance_tension(&mut self, elapsed: f64) -> Result<(), Interrupted> {
        let Self { varying, interface, particles, columns, flow, droplets, interrupt, .. } = self;
        let Some(varying) = varying else { return Ok(()) };
        let surroundings = Surroundings { columns, flow, droplets, candidates: interface.candidates() };
        varying.advance(particles, surroundings, elapsed, interrupt)
    }

    fn sum_densities(&mut self) -> Result<(), Interrupted> {
        let Self { pairs, flow, walls, .. } = self;
        let of_walls: &mut [f64] = walls.as_mut().map_or(&mut [], |walls| &mut walls.volume);
        density_summation::sum_volumes(pairs, flow.calibration, &mut flow.volume, of_walls)?;
        self.flow.derive_densities();
        Ok(())
    }

    fn add_forces(&mut self, time: f64) {
        let Self { particles, columns, flow, interface, droplets, tension, varying, band, forces, rates, .. } = self;
        let (contact_lines, line_forces) = (&self.contact_lines, &mut self.line_forces);
        let field = varying.as_ref().map(|varying| &varying.field);
        let moment = Moment { time, particles, columns, flow, interface, droplets, tension: field };
        if let Some(tension) = tension {
            tension.find_band_forces(band, &moment);
            for (i, force) in &band.forces {
                rates.acceleration[*i] += force;
            }
        }
        if let Some(lines) = contact_lines {
            lines.find_forces(line_forces, &moment);
            for (i, force) in line_forces.iter() {
                rates.acceleration[*i] += force;
            }
        }
        for force in forces.iter() {
            force.add_to(&mut rates.acceleration, &moment);
        }
    }

    /// What forces on particles depend on at a time.
    pub(super) fn moment(&self, time: f64) -> Moment<'_, D> {
        let Self { particles, columns, flow, interface, droplets, varying, .. } = self;
        let tension = varying.as_ref().map(|varying| &varying.field);
        Moment { time, particles, columns, flow, interface, droplets, tension }
    }

    /// The force of surface tension, where there is one.
    pub(super) fn tension(&self) -> Option<&SurfaceTension> {
        self.tension.as_ref()
    }

    /// The part of the pressure that the balanced force has absorbed, at a particle.
    pub(super) fn absorbed_pressure(&self, i: usize) -> f64 {
        if self.flow.species[i] == Species::Inside { self.absorbed_inside(i) } else { 0.0 }
    }

    /// The part of the pressure inside that the balanced force has absorbed, of the droplet that a particle belongs to.
    pub(super) fn absorbed_inside(&self, i: usize) -> f64 {
        let field = self.varying.as_ref().map(|varying| &varying.field);
        self.tension.as_ref().map_or(0.0, |tension| tension.absorbed_pressure(&self.droplets, field, i))
    }

    fn count_droplets(&mut self) -> Option<usize> {
        let Self { droplets, particles, flow, config, interface, .. } = self;
        droplets.count(&Searched {
            positions: particles.positions(),
            species: &flow.species,
            near: interface.candidates(),
            spacing: config.spacing,
            cutoff: interface.level_set().map_or(0.0, LevelSet::keep),
            container: config.container.as_ref(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Drop, Instant, Interface, SphSystem};
    use crate::geometry::Vector;
    use crate::parallel::Interrupt;
    use crate::schemes::weakly_compressible_sph::test_setting::{Setting, setting};
    use crate::schemes::weakly_compressible_sph::{
        BodyForce, DensityMethod, KernelChoice, Species, SphConfig, TensionForce,
    };
    use crate::simulation::{CpuClock, Phases};

    fn evaluated(this: &Setting<2>, config: SphConfig<2>, level: Vec<f64>) -> SphSystem<2> {
        let drop = Drop { level, ..this.drop(2.0) };
        let mut system = SphSystem::new(config, this.domain.clone(), this.cell, drop, Interrupt::default()).unwrap();
        system.flow.predicted.clone_from(&this.velocity);
        system.evaluate(Instant::default(), &mut Phases::new(CpuClock::still())).unwrap();
        system
    }

    /// Σ m a by Σ m |a|.
    fn net_force(system: &SphSystem<2>) -> f64 {
        let forces = system.rates.acceleration.iter().enumerate().map(|(i, a)| a * system.flow.mass(i));
        let (all, sizes) = forces.fold((Vector::<2>::zeros(), 0.0), |(all, sizes), f| (all + f, sizes + f.norm()));
        all.norm() / sizes
    }

    #[test]
    fn interactions_between_particles_keep_momentum_and_a_body_force_adds_its_own() {
        let this = setting::<2>(KernelChoice::WendlandC2, 3.0);
        for density in [DensityMethod::Summation, DensityMethod::Continuity { diffusion: 0.1 }] {
            let config = SphConfig { tension: 0.0, density, ..this.config.clone() };
            let free = evaluated(&this, config.clone(), this.level.clone());
            assert!(net_force(&free) < 1e-13, "{}", net_force(&free));
            let gravity = Vector::<2>::new(0.0, -9.0);
            let config = SphConfig { body_force: Some(BodyForce::Constant(gravity)), ..config };
            let falling = evaluated(&this, config, this.level.clone());
            for (a, b) in falling.rates.acceleration.iter().zip(&free.rates.acceleration) {
                assert!((a - b - gravity).norm() < 1e-9 * b.norm().max(1.0));
            }
        }
    }

    #[test]
    fn the_balanced_force_moves_the_pressure_of_the_droplet_into_the_pressure() {
        let this = setting::<2>(KernelChoice::WendlandC2, 1.0);
        let center = Vector::<2>::new(0.6, 0.6);
        let level: Vec<f64> =
            this.positions.iter().map(|x| this.domain.displacement(&center, x).norm() - 0.8).collect();
        let config = SphConfig { tension: 3.0, tension_force: TensionForce::Balanced, ..this.config.clone() };
        let balanced = evaluated(&this, config.clone(), level.clone());
        assert!(matches!(balanced.interface, Interface::ColorField(_)));
        assert_eq!(balanced.droplets.number(), 1);
        // κ₀ of the measure 2 that was given, times τ.
        let expected = 3.0 * (std::f64::consts::PI / 2.0).sqrt();
        let csf = evaluated(&this, SphConfig { tension_force: TensionForce::Csf, ..config }, level);
        for i in this.probes() {
            let absorbed = if balanced.flow.species[i] == Species::Inside { expected } else { 0.0 };
            assert!((balanced.absorbed_pressure(i) - absorbed).abs() < 1e-14);
            assert_eq!(csf.absorbed_pressure(i), 0.0);
        }
        // The two forces differ by τ κ₀ n δ/ρ.
        let Interface::ColorField(color) = &balanced.interface else { panic!("no color field") };
        for (i, (a, b)) in balanced.rates.acceleration.iter().zip(&csf.rates.acceleration).enumerate() {
            let difference = color.gradient[i] * (expected / balanced.flow.density[i]);
            assert!((a - b - difference).norm() < 1e-9 * a.norm().max(1.0));
        }
    }
}
