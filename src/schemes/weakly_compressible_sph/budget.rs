//! Budgets of energy and momentum: what a run has, and what came in from outside.

use super::interface::Interface;
use super::smoothed_delta::smoothed_delta;
use super::species::Species;
use super::system::SphSystem;
use super::varying_tension::VaryingTension;
use super::walls::{WallSupply, Walls};
use crate::geometry::Vector;
use crate::simulation::section::known;
use crate::simulation::{Component, LoadError, Region, Section, StepError};
use crate::time::Clock;

/// Energies and momentum of one state.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contents<const D: usize> {
    /// Σ m u²/2.
    pub kinetic: f64,
    /// Σ m e(ρ) − p_b Σ (V − V₀).
    pub elastic: f64,
    /// Perimeter or surface area, Σ V δ(φ); NaN without a level set.
    pub interface: f64,
    /// Energy of the interface, τ times it or the integral of what varies, and of the walls that drops cover.
    pub surface: f64,
    /// Σ m u.
    pub momentum: Vector<D>,
    /// Σ m |u|.
    pub momentum_size: f64,
    /// Σ m.
    pub mass: f64,
}

impl<const D: usize> Contents<D> {
    /// Kinetic energy of the motion about the mean velocity.
    pub fn inner_kinetic(&self) -> f64 {
        self.kinetic - 0.5 * self.momentum.norm_squared() / self.mass
    }
}

impl<const D: usize> SphSystem<D> {
    /// Energies and momentum of the present state.
    pub(super) fn contents(&self) -> Contents<D> {
        let flow = &self.flow;
        let mut contents = Contents {
            kinetic: 0.0,
            elastic: 0.0,
            interface: self.interface_measure(),
            surface: 0.0,
            momentum: Vector::<D>::zeros(),
            momentum_size: 0.0,
            mass: 0.0,
        };
        let constant = self.config.tension * contents.interface;
        contents.surface = self.varying.as_ref().map_or(constant, VaryingTension::surface_energy);
        contents.surface += self.wetting_energy();
        for (i, u) in flow.velocity.iter().enumerate() {
            let mass = flow.mass(i);
            contents.mass += mass;
            contents.kinetic += 0.5 * mass * u.norm_squared();
            contents.momentum += u * mass;
            contents.momentum_size += mass * u.norm();
            contents.elastic += mass * flow.fluid(i).elastic_energy(flow.density[i]);
            contents.elastic -= flow.background * (mass / flow.density[i] - flow.cell);
        }
        contents
    }

    /// The volume, or of the interface the length or area, that each particle stands for in a region.
    pub(super) fn weights(&self, region: Region) -> Option<Vec<f64>> {
        let (species, volume) = (&self.flow.species, &self.flow.volume);
        let of =
            |wanted: Species| species.iter().zip(volume).map(|(s, v)| if *s == wanted { *v } else { 0.0 }).collect();
        match region {
            Region::All => Some(volume.clone()),
            Region::Inside => Some(of(Species::Inside)),
            Region::Outside => Some(of(Species::Outside)),
            Region::Interface => {
                let Interface::LevelSet(level_set) = &self.interface else { return None };
                let (phi, band) = (self.particles.scalar(self.columns.phi), self.particles.flag(self.columns.in_band));
                let mut weights = vec![0.0; volume.len()];
                for i in level_set.candidates().iter().filter(|i| band[**i] == 1) {
                    weights[*i] = volume[*i] * smoothed_delta(phi[*i], self.config.smoothing_length);
                }
                Some(weights)
            }
            Region::Surface => None,
        }
    }

    fn interface_measure(&self) -> f64 {
        let Interface::LevelSet(level_set) = &self.interface else { return f64::NAN };
        let (phi, band) = (self.particles.scalar(self.columns.phi), self.particles.flag(self.columns.in_band));
        let near = level_set.candidates().iter().filter(|i| band[**i] == 1);
        near.map(|i| self.flow.volume[*i] * smoothed_delta(phi[*i], self.config.smoothing_length)).sum()
    }

    /// Power Σ m a·u and sum Σ m a of what comes from outside at a time: the body force, walls, images that slide, and what keeps up a
    /// slope of the tension.
    pub(super) fn body_force_sums(&self, time: f64) -> (f64, Vector<D>) {
        let mut sums = (0.0, Vector::<D>::zeros());
        if let Some(force) = &self.config.body_force {
            for (i, x) in self.particles.positions().iter().enumerate() {
                let acceleration = force.acceleration(x, time, self.flow.species[i]);
                let mass = self.flow.mass(i);
                sums.0 += mass * acceleration.dot(&self.flow.velocity[i]);
                sums.1 += acceleration * mass;
            }
        }
        if let Some(varying) = &self.varying {
            sums.0 += varying.supplied_power(&self.flow.velocity);
        }
        if let Some(WallSupply { power, force }) = self.walls.as_ref().map(Walls::supply) {
            sums.0 += power;
            sums.1 += force + self.held_by_walls();
        }
        let (power, force) = self.shear_supply();
        (sums.0 + power, sums.1 + force)
    }

    /// The error of a step after which a velocity is not finite: that the body force has no value, where that is so.
    pub(super) fn explained(&self, error: StepError, Clock { step, time }: Clock) -> StepError {
        let (StepError::NonFinite { particle, .. }, Some(force)) = (&error, &self.config.body_force) else {
            return error;
        };
        let place = self.particles.positions()[*particle];
        match force.fault(&place, time, self.flow.species[*particle]) {
            Some(reason) => StepError::Undefined { reason: format!("{reason}, particle {particle}"), step, time },
            None => error,
        }
    }

    /// Power Σ m a·u of surface tension.
    pub(super) fn tension_power(&self) -> f64 {
        self.band.forces.iter().map(|(i, a)| self.flow.mass(*i) * a.dot(&self.flow.velocity[*i])).sum()
    }
}

/// What came in since the start, and what there was then.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Budget<const D: usize> {
    /// Kinetic and elastic energy at the start.
    pub start_energy: f64,
    /// Perimeter or surface area at the start; NaN before the first measurement and without a level set.
    pub start_interface: f64,
    /// Energy of the interface at the start.
    pub start_surface: f64,
    /// Enclosed area or volume at the first measurement; NaN before.
    pub start_measure: f64,
    /// Work of the body force, of moving walls and of what keeps up a slope of the tension, ∫ Σ m a·u dt by trapezoids.
    pub work: f64,
    /// ∫ Σ m a dt of the body force and of walls by trapezoids.
    pub impulse: Vector<D>,
    /// Work of surface tension, ∫ Σ m a·u dt by trapezoids.
    pub tension_work: f64,
    /// Momentum at the start.
    pub start_momentum: Vector<D>,
}

impl<const D: usize> Budget<D> {
    /// The budget of a state at the start.
    pub fn new(contents: &Contents<D>) -> Self {
        Self {
            start_energy: contents.kinetic + contents.elastic,
            start_interface: contents.interface,
            start_surface: contents.surface,
            start_measure: f64::NAN,
            work: 0.0,
            impulse: Vector::<D>::zeros(),
            tension_work: 0.0,
            start_momentum: contents.momentum,
        }
    }

    /// Energy gained from nothing: kinetic, elastic and surface energy beyond that of the start and the work done.
    pub fn gain(&self, contents: &Contents<D>) -> f64 {
        let surface = contents.surface - self.start_surface;
        contents.kinetic + contents.elastic - self.start_energy + surface - self.work
    }

    /// Momentum gained from nothing.
    pub fn momentum_gain(&self, contents: &Contents<D>) -> f64 {
        (contents.momentum - self.start_momentum - self.impulse).norm()
    }
}

impl<const D: usize> Component for Budget<D> {
    fn save(&self, section: &mut Section) {
        section.put_real("start_energy", self.start_energy);
        section.put_optional("start_interface", known(self.start_interface));
        section.put_optional("start_surface", known(self.start_surface));
        section.put_optional("start_measure", known(self.start_measure));
        section.put_real("work", self.work);
        section.put_vectors("impulse", &[self.impulse]);
        section.put_real("tension_work", self.tension_work);
        section.put_vectors("start_momentum", &[self.start_momentum]);
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        let value = |name: &str| match section.has(name) {
            true => Ok(section.optional(name)?.unwrap_or(f64::NAN)),
            false => Ok::<f64, LoadError>(f64::NAN),
        };
        let vector = |name: &str| Ok::<_, LoadError>(Vector::<D>::from_column_slice(section.reals_of(name, D)?));
        Ok(Self {
            start_energy: section.real("start_energy")?,
            start_interface: section.optional("start_interface")?.unwrap_or(f64::NAN),
            // Earlier versions had one tension everywhere; see [`Guard::load`].
            start_surface: value("start_surface")?,
            start_measure: section.optional("start_measure")?.unwrap_or(f64::NAN),
            work: section.real("work")?,
            impulse: vector("impulse")?,
            tension_work: section.real("tension_work")?,
            start_momentum: vector("start_momentum")?,
        })
    }
}
