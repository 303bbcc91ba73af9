//! The particles of an advected level set, their transport and their redistancing.

use crate::closest_point::method::NeighborhoodChoice;
use crate::closest_point::{
    ClosestPoints, Coverage, LevelSurface, MaterialSurface, PcpMethod, Redistancing, SurfaceColumns,
};
use crate::geometry::lattice::Lattice;
use crate::geometry::{Domain, Surface, Vector};
use crate::parallel::{Interrupt, Interrupted};
use crate::particles::{Particles, ScalarKey};
use crate::schemes::exact_motion::ExactMotion;
use crate::schemes::measured_redistancing::{query, rebuild};
use crate::simulation::{CpuClock, Phases};
use crate::time::PathIntegrator;
use crate::time::integrators::{PATHS, PathError, longer};
use rayon::prelude::{ParallelIterator, ParallelSliceMut};

/// What is transported, and what distances are written to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldChoice {
    /// ψ with Dψ/Dt = 0 is never touched; distances are an array of their own.
    Dual,
    /// The distance replaces the transported value (the paper).
    Overwrite,
}

/// When to redistance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RedistanceWhen {
    /// After every so many steps.
    Every(u64),
    /// Only when a frame or an error needs it.
    ForOutput,
}

/// Particles in a flow.
pub struct AdvectedSystem<const D: usize> {
    /// Surface and flow: the exact answer.
    pub(super) motion: ExactMotion<D>,
    pub(super) parts: AdvectedParts,
    pub(super) particles: Particles<D>,
    /// ψ, constant along paths (dual) or the distance of the last redistancing.
    pub(super) psi: ScalarKey,
    pub(super) columns: SurfaceColumns,
    pub(super) redistancing: LevelSurface<D>,
    pub(super) answers: ClosestPoints<D>,
    pub(super) interrupt: Interrupt,
}

/// Particles at time 0.
#[derive(Debug, Clone)]
pub struct Start<const D: usize> {
    /// Positions of the particles.
    pub positions: Vec<Vector<D>>,
    /// Level of each particle.
    pub level: Vec<f64>,
}

impl<const D: usize> Start<D> {
    /// On a lattice within `reach` of a surface, with the exact distance as level.
    #[must_use]
    pub fn about(surface: &dyn Surface<D>, lattice: &Lattice, reach: f64, interrupt: &Interrupt) -> Self {
        let (low, high) = surface.bounding_box();
        let margin = reach + lattice.spacing;
        let (low, high) = (low.add_scalar(-margin), high.add_scalar(margin));
        let positions = lattice.points_near(&low, &high, reach, |x| surface.signed_distance(x), interrupt);
        let level = positions.iter().map(|x| surface.signed_distance(x)).collect();
        Self { positions, level }
    }
}

/// A redistanced copy of the particles.
pub(super) struct Copied<const D: usize> {
    /// The particles with the surface columns of the present moment.
    pub particles: Particles<D>,
    /// Their surface.
    pub surface: LevelSurface<D>,
    /// How far its answers can be trusted.
    pub coverage: Coverage,
}

/// What a run in a flow is made of, beside particles and flow.
#[derive(Debug, Clone)]
pub struct AdvectedParts {
    /// Particle spacing h.
    pub spacing: f64,
    /// Half width w/2 of the band.
    pub half_band: f64,
    /// Integrator of the particle paths.
    pub integrator: PathIntegrator,
    /// Choice of the transported level-set function.
    pub field: FieldChoice,
    /// When to redistance.
    pub when: RedistanceWhen,
    /// Parameters of the closest-point method.
    pub method: PcpMethod,
}

impl<const D: usize> AdvectedSystem<D> {
    /// Particles with a level, in a flow. Where the surface is known, columns start with the exact answers.
    #[must_use]
    pub fn new(motion: ExactMotion<D>, start: Start<D>, parts: AdvectedParts, interrupt: Interrupt) -> Self {
        let AdvectedParts { spacing, half_band, ref method, .. } = parts;
        let mut particles = Particles::new(start.positions);
        let psi = particles.add_scalar("psi", 0.0);
        let columns = SurfaceColumns::add(&mut particles);
        particles.scalar_mut(psi).copy_from_slice(&start.level);
        particles.scalar_mut(columns.phi).copy_from_slice(&start.level);
        for (flag, level) in particles.flag_mut(columns.in_band).iter_mut().zip(&start.level) {
            *flag = u8::from(level.abs() <= half_band);
        }
        if let Some(surface) = motion.surface() {
            for i in 0..particles.len() {
                let exact = surface.nearest(&particles.positions()[i]);
                particles.vector_mut(columns.closest_point)[i] = exact.point;
                particles.vector_mut(columns.normal)[i] = exact.normal.unwrap_or_else(Vector::<D>::zeros);
                particles.scalar_mut(columns.curvature)[i] = exact.curvature.unwrap_or(0.0);
            }
        }
        let answers = ClosestPoints::default();
        let redistancing = if let NeighborhoodChoice::Material { .. } = method.neighborhood {
            let (positions, level) = (particles.positions(), particles.scalar(psi));
            let surface = MaterialSurface::new(method.clone(), spacing, positions, level, &interrupt);
            LevelSurface::Material(Box::new(surface))
        } else {
            LevelSurface::Spatial(Box::new(Redistancing::new(method.clone(), Domain::unbounded(), spacing)))
        };
        Self { motion, parts, particles, psi, columns, redistancing, answers, interrupt }
    }

    /// Moves every particle along its path; returns the longest way in spacings.
    pub(super) fn advect(&mut self, time: f64, step: f64) -> Result<f64, PathError> {
        let (flow, integrator, interrupt) = (self.motion.flow(), self.parts.integrator, &self.interrupt);
        let longest = self
            .particles
            .positions_mut()
            .par_chunks_mut(PATHS)
            .map(|block| integrator.carry(flow, block, time, step, interrupt))
            .reduce(|| Ok(0.0), longer)?;
        Ok(longest / self.parts.spacing)
    }

    /// Rebuilds the surface from ψ and writes distance, closest point, normal and curvature of the band.
    pub(super) fn redistance(&mut self, phases: &mut Phases) -> Result<(), Interrupted> {
        let Self { parts, particles, psi, columns, redistancing, answers, interrupt, .. } = self;
        ask(redistancing, parts, particles, *psi, columns, answers, interrupt, phases)?;
        phases.measure("redistancing/store", || self.store());
        Ok(())
    }

    /// Writes the answers, and the distances over ψ where the scene says so.
    fn store(&mut self) {
        let half_band = self.parts.half_band;
        self.columns.store(&mut self.particles, self.psi, &self.answers, half_band);
        if self.parts.field == FieldChoice::Overwrite {
            // The distance from a mere sample is worse than what the particle has carried here.
            for (i, _) in self.answers.iter().filter(|(_, a)| a.distance <= half_band && !a.is_sample) {
                let phi = self.particles.scalar(self.columns.phi)[i];
                self.particles.scalar_mut(self.psi)[i] = phi;
            }
        }
    }

    /// Share of the particles with a negative level; those within h/2 of the surface count in part.
    pub(super) fn inside_share(&self) -> f64 {
        let level = self.particles.scalar(self.psi);
        let inside = |psi: &f64| (0.5 - psi / self.parts.spacing).clamp(0.0, 1.0);
        level.iter().map(inside).sum::<f64>() / level.len().max(1) as f64
    }

    /// How far the answers of the last redistancing can be trusted.
    pub(super) fn coverage(&self) -> Coverage {
        Coverage::new(&self.redistancing, &self.answers, self.particles.len())
    }

    /// A copy of the particles with the surface columns of the present moment, and its surface, for what is asked
    /// between redistancings.
    pub(super) fn redistanced_copy(&self, interrupt: &Interrupt) -> Result<Copied<D>, Interrupted> {
        let mut particles = self.particles.clone();
        let mut surface = match &self.redistancing {
            LevelSurface::Material(surface) => LevelSurface::Material(Box::new(surface.fresh())),
            LevelSurface::Spatial(_) | LevelSurface::Stretched(_) => {
                let (method, domain) = (self.parts.method.clone(), Domain::unbounded());
                LevelSurface::Spatial(Box::new(Redistancing::new(method, domain, self.parts.spacing)))
            }
        };
        let (mut answers, mut phases) = (ClosestPoints::default(), Phases::new(CpuClock::still()));
        let Self { parts, psi, columns, .. } = self;
        ask(&mut surface, parts, &self.particles, *psi, columns, &mut answers, interrupt, &mut phases)?;
        columns.store(&mut particles, *psi, &answers, parts.half_band);
        let coverage = Coverage::new(&surface, &answers, particles.len());
        Ok(Copied { particles, surface, coverage })
    }
}

/// Rebuilds a surface from ψ and queries every particle within w/2 of it (PCP 3.4). Branches are told apart by the normals
/// of the last redistancing, where a schedule keeps them fresh.
#[expect(clippy::too_many_arguments, reason = "parts of a system, of which a copy replaces some")]
fn ask<const D: usize>(
    surface: &mut LevelSurface<D>,
    parts: &AdvectedParts,
    particles: &Particles<D>,
    psi: ScalarKey,
    columns: &SurfaceColumns,
    answers: &mut ClosestPoints<D>,
    interrupt: &Interrupt,
    phases: &mut Phases,
) -> Result<(), Interrupted> {
    let positions = particles.positions();
    let normals = matches!(parts.when, RedistanceWhen::Every(_)).then(|| particles.vector(columns.normal));
    rebuild(surface, positions, particles.scalar(psi), normals, interrupt, phases)?;
    query(surface, positions, parts.half_band, answers, interrupt, phases)
}
