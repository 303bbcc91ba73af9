//! The front: its foot points, and how a step moves and renews them.

use super::config::FrontConfig;
use super::foot_points::FootPoints;
use super::gaps::GapSearch;
use super::laws::{MotionStep, MovingFront, Stages};
use super::placement::Placement;
use super::reconstructor::Reconstructor;
use super::refinement::Refinement;
use super::removals::Removals;
use super::resampling::Resampling;
use super::sweep::SweepTest;
use crate::geometry::{Surface, Vector};
use crate::parallel::Interrupted;
use crate::simulation::{Phases, StepError};
use crate::time::Clock;
use crate::time::integrators::PathError;

/// A front in D dimensions; M dimensions lie along it, M = D − 1 of a surface.
pub struct FrontSystem<const D: usize, const M: usize> {
    pub(super) config: FrontConfig<D, M>,
    pub(super) feet: FootPoints<D>,
    pub(super) removals: Removals,
    reconstructor: Reconstructor<D, M>,
    refinement: Refinement,
    resampling: Resampling<D>,
    stages: Stages<D>,
    /// Whether each particle stays when segments merge.
    keep: Vec<bool>,
}

impl<const D: usize, const M: usize> FrontSystem<D, M> {
    /// A front of known foot points.
    #[must_use]
    pub fn new(feet: FootPoints<D>, config: FrontConfig<D, M>) -> Self {
        Self {
            reconstructor: Reconstructor::new(config.method.degree),
            config,
            feet,
            removals: Removals::default(),
            refinement: Refinement::default(),
            resampling: Resampling::default(),
            stages: Stages::default(),
            keep: Vec::new(),
        }
    }

    /// The foot points of all grid points within the tube about the closed parts of a front (GBPM 3.2).
    ///
    /// At a corner a surface has no normal. Where a corner opens it gets a fan of particles; elsewhere its sides continue until
    /// they meet. Where the grid is refined, coarse foot points first tell where; an interrupt ends that early, and then the
    /// first step.
    #[must_use]
    pub fn from_surfaces(surfaces: &[Box<dyn Surface<D>>], config: FrontConfig<D, M>) -> Self {
        let levels = config.method.levels();
        let mut system = Self::new(FootPoints::default(), config);
        system.place_on(surfaces);
        for _ in 1..levels {
            let before = system.refinement.count();
            if system.refine().is_err() || system.refinement.count() == before {
                break;
            }
            system.place_on(surfaces);
        }
        system
    }

    /// Replaces the foot points by those of the surfaces on the grid as it is refined.
    fn place_on(&mut self, surfaces: &[Box<dyn Surface<D>>]) {
        let Self { config, feet, refinement, .. } = self;
        Placement { surfaces, config, refinement }.place(feet);
    }

    /// Number of foot points.
    #[must_use]
    pub fn particle_count(&self) -> usize {
        self.feet.len()
    }

    /// Length or area of the front up to a constant factor: each foot point stands for h^M of its level.
    pub(super) fn area_or_length(&self) -> f64 {
        self.feet.nodes.iter().map(|node| self.config.grid.spacing_of(*node).powi(M as i32)).sum()
    }

    /// Indices of the foot points that lack a neighbor of their segment on some side.
    pub(super) fn open_ends(&mut self) -> Vec<usize> {
        let Self { config, feet, reconstructor, .. } = self;
        reconstructor.sort(feet, &config.grid);
        let search = GapSearch { feet, cells: reconstructor.cells(), config };
        (0..feet.len()).filter(|i| search.is_at_gap(*i)).collect()
    }

    /// Moves and renews the foot points. Returns the longest displacement in spacings of the finest level.
    ///
    /// 1. Move the particles by the law. 2. Check that all numbers are finite. 3. Remove what other segments have swept.
    /// 4. Resample.
    pub(super) fn advance(&mut self, from: Clock, to: Clock, step: f64, phases: &mut Phases) -> Result<f64, StepError> {
        let clock = phases.clock();
        let start = clock();
        let displacement = self.move_particles(from.time, step).map_err(|error| StepError::from_path(error, to))?;
        self.check_finite(to)?;
        let moved = clock();
        phases.book("front/motion", moved - start);
        self.remove_swept(from.time, step)?;
        let swept = clock();
        phases.book("front/topology", swept - moved);
        self.resample()?;
        self.check_finite(to)?;
        phases.book("front/resampling", clock() - swept);
        Ok(displacement)
    }

    /// Moves the particles by the law. Returns the longest displacement in spacings of the finest level.
    fn move_particles(&mut self, time: f64, step: f64) -> Result<f64, PathError> {
        let Self { config, feet, reconstructor, stages, .. } = self;
        let config = &*config;
        let mut renew_geometry = |feet: &mut FootPoints<D>| reconstructor.renew_geometry(feet, config);
        let mut front = MovingFront { feet, stages, renew_geometry: &mut renew_geometry };
        let spacing = config.finest_spacing();
        let motion = MotionStep { time, step, integrator: config.integrator, spacing, interrupt: &config.interrupt };
        config.law.advance(&mut front, &motion)
    }

    /// Fails where a position or a normal is not finite.
    fn check_finite(&self, Clock { step, time }: Clock) -> Result<(), StepError> {
        let is_broken = |vectors: &[Vector<D>]| vectors.iter().position(|x| !x.iter().all(|c| c.is_finite()));
        for (field, vectors) in [("position", &self.feet.positions), ("normal", &self.feet.normals)] {
            if let Some(particle) = is_broken(vectors) {
                return Err(StepError::NonFinite { field, particle, step, time });
            }
        }
        Ok(())
    }

    /// Removes the particles that another segment has passed, where segments merge.
    fn remove_swept(&mut self, time: f64, step: f64) -> Result<(), Interrupted> {
        if !self.config.merges() {
            return Ok(());
        }
        let Self { config, feet, reconstructor, keep, removals, .. } = self;
        reconstructor.sort(feet, &config.grid);
        let displacement = |i: usize| config.law.normal_displacement(feet, i, time, step);
        SweepTest { feet, cells: reconstructor.cells(), config, displacement }.mark_unswept(keep)?;
        let removed = keep.iter().filter(|keep| !**keep).count();
        if removed > 0 {
            removals.swept += removed as u64;
            feet.retain(keep);
        }
        Ok(())
    }

    /// Splits the cells of the grid where the particles need it.
    fn refine(&mut self) -> Result<(), Interrupted> {
        let Self { config, feet, reconstructor, refinement, .. } = self;
        reconstructor.sort(feet, &config.grid);
        refinement.renew(feet, reconstructor.cells(), config)
    }

    /// Refines the grid and replaces the particles by the foot points of the grid points near them.
    fn resample(&mut self) -> Result<(), Interrupted> {
        self.refine()?;
        let Self { config, feet, reconstructor, refinement, resampling, removals, .. } = self;
        resampling.resample(feet, config, reconstructor, refinement, removals)
    }
}
