//! The front: its foot-points, and how a step moves and renews them.

use super::corners::{for_each_fan, of_mean_direction};
use super::foot_points::{FootPoint, FootPoints};
use super::grid::{Grid, Node};
use super::local_graph::Terms;
use super::method::FrontMethod;
use super::motion::{self, Law};
use super::reconstruction::{Failure, Reconstruction, Room};
use super::refinement::Refinement;
use super::resampling::{Outcome, Proposals, Removals, fill};
use super::segments::{Course, Segments};
use super::topology::{Topology, mark_unswept};
use crate::geometry::{Domain, Surface, Vector};
use crate::neighbors::CellList;
use crate::parallel::{Interrupt, Interrupted, PerThread};
use crate::simulation::{Phases, StepError};
use crate::time::{Clock, PathIntegrator};

/// What a front is made of beside its foot-points.
pub struct FrontParts<const D: usize> {
    /// The underlying grid.
    pub grid: Grid,
    /// Reconstruction.
    pub method: FrontMethod,
    /// What moves it.
    pub law: Law<D>,
    /// Path integrator, of a flow and of motion by curvature.
    pub integrator: PathIntegrator,
    /// What happens where segments meet.
    pub topology: Topology,
    /// How segments are told apart beside their normals.
    pub segments: Segments,
    /// Asks a running step to be dropped.
    pub interrupt: Interrupt,
}

/// A front in D dimensions, M = D − 1.
pub struct FrontSystem<const D: usize, const M: usize> {
    pub(super) parts: FrontParts<D>,
    pub(super) feet: FootPoints<D>,
    /// The next ones in the making.
    pub(super) fresh: FootPoints<D>,
    pub(super) cells: CellList<D>,
    pub(super) fresh_cells: CellList<D>,
    pub(super) terms: Terms<M>,
    pub(super) quadratic: Terms<M>,
    /// Grid points that the particles propose, block by block, and all of them together.
    pub(super) proposals: Vec<Proposals>,
    pub(super) candidates: Vec<Node>,
    pub(super) outcomes: Vec<Outcome<D>>,
    pub(super) rooms: PerThread<Room<D, M>>,
    pub(super) refinement: Refinement,
    /// Of every moved particle, whether it is next to a gap or at the end of its segment, in a flow.
    pub(super) at_gap: Vec<bool>,
    pub(super) removals: Removals,
    /// Which particles stay.
    pub(super) keep: Vec<bool>,
    /// Positions at the start of a step, and the sum of its stages' velocities.
    starts: Vec<Vector<D>>,
    slopes: Vec<Vector<D>>,
}

impl<const D: usize, const M: usize> FrontSystem<D, M> {
    /// The foot-points of all grid points within the tube about the parts of a front (GBPM 3.2).
    ///
    /// At a corner a surface has no normal: where it opens it gets a fan of particles, elsewhere the sides go on until they meet.
    ///
    /// Where the grid is refined, coarse foot-points first tell where; an interrupt ends that early, and then the first step.
    #[must_use]
    pub fn about(surfaces: &[Box<dyn Surface<D>>], parts: FrontParts<D>) -> Self {
        let levels = parts.method.levels();
        let mut system = Self::of(FootPoints::default(), parts);
        system.place_on(surfaces);
        for _ in 1..levels {
            let before = system.refinement.count();
            system.sort_cells();
            if system.refine().is_err() || system.refinement.count() == before {
                break;
            }
            system.place_on(surfaces);
        }
        system
    }

    /// Foot-points that are known.
    #[must_use]
    pub fn of(feet: FootPoints<D>, parts: FrontParts<D>) -> Self {
        let (terms, quadratic) = (Terms::new(parts.method.degree), Terms::new(2));
        Self {
            parts,
            feet,
            fresh: FootPoints::default(),
            cells: CellList::new(Domain::unbounded()),
            fresh_cells: CellList::new(Domain::unbounded()),
            terms,
            quadratic,
            proposals: Vec::new(),
            candidates: Vec::new(),
            outcomes: Vec::new(),
            rooms: PerThread::new(),
            refinement: Refinement::default(),
            at_gap: Vec::new(),
            removals: Removals::default(),
            keep: Vec::new(),
            starts: Vec::new(),
            slopes: Vec::new(),
        }
    }

    /// Foot-points of the grid as it is refined.
    fn place_on(&mut self, surfaces: &[Box<dyn Surface<D>>]) {
        let Self { parts, feet, refinement, .. } = self;
        let mut near: Vec<(Node, FootPoint<D>)> = Vec::new();
        // Levels below one without parts have no cells.
        let has_cells = |level: &u32| refinement.splits_level(*level);
        let levels = 1 + (0..parts.method.levels() - 1).take_while(has_cells).count() as u32;
        for level in 0..levels {
            let radius = parts.method.tube_radius * parts.grid.spacing_at(level);
            for (part, surface) in surfaces.iter().enumerate() {
                for_each_near(surface.as_ref(), radius, (&parts.grid, level), |at, place| {
                    let exact = surface.nearest(&place);
                    let is_active = exact.distance.abs() <= radius && refinement.is_leaf(at, level);
                    if let Some(normal) = exact.normal.filter(|_| is_active) {
                        let (position, curvature) = (exact.point, exact.curvature.unwrap_or(0.0));
                        let foot = FootPoint {
                            position,
                            normal,
                            curvature,
                            gauss_curvature: 0.0,
                            part: part as u32,
                            parameter: 0.0,
                        };
                        near.push((Grid::node(at, level), foot));
                    }
                });
            }
        }
        // Where parts share a grid point the nearer one has it.
        let distance = |(node, foot): &(Node, FootPoint<D>)| (foot.position - parts.grid.place::<D>(*node)).norm();
        near.sort_by(|a, b| a.0.cmp(&b.0).then(distance(a).total_cmp(&distance(b))).then(a.1.part.cmp(&b.1.part)));
        near.dedup_by_key(|(node, _)| *node);
        feet.clear();
        for (node, foot) in &near {
            feet.push(*node, foot);
        }
        for level in 0..levels {
            for (part, surface) in surfaces.iter().enumerate() {
                let opens = |distance: f64| parts.law.opens_corners(distance);
                let mut fans = Vec::new();
                for_each_fan(surface.as_ref(), (&parts.grid, level), opens, |place, normal| fans.push((place, normal)));
                if matches!(parts.law, Law::MeanCurvature) {
                    fans = of_mean_direction(fans);
                }
                for (position, normal) in fans {
                    let leaf = refinement.leaf_at(&parts.grid, &position);
                    if let Some(node) = leaf.filter(|node| Grid::level(*node) == level) {
                        let (curvature, gauss_curvature) = (0.0, 0.0);
                        let (part, parameter) = (part as u32, 0.0);
                        feet.push(node, &FootPoint { position, normal, curvature, gauss_curvature, part, parameter });
                    }
                }
            }
        }
        if parts.segments.parameter.is_some() {
            let finest = parts.grid.spacing_at(parts.method.levels() - 1);
            let courses: Vec<_> = surfaces.iter().map(|surface| Course::of(surface.as_ref(), 0.25 * finest)).collect();
            for i in 0..feet.len() {
                let course = courses.get(feet.parts[i] as usize).and_then(Option::as_ref);
                feet.parameters[i] = course.map_or(0.0, |course| course.parameter(&feet.positions[i]));
            }
        }
    }

    /// How many foot-points there are.
    #[must_use]
    pub fn particle_count(&self) -> usize {
        self.feet.len()
    }

    /// The length or area of the front by its foot-points, up to a factor: each stands for its own spacing.
    pub(super) fn measure(&self) -> f64 {
        self.feet.nodes.iter().map(|node| self.parts.grid.spacing_of(*node).powi(M as i32)).sum()
    }

    /// h of the finest level.
    fn finest(&self) -> f64 {
        self.parts.grid.spacing_at(self.parts.method.levels() - 1)
    }

    /// The foot-points that have nobody of their segment on some side.
    pub(super) fn ends(&mut self) -> Vec<usize> {
        self.sort_cells();
        (0..self.feet.len()).filter(|i| self.is_at_gap(*i)).collect()
    }

    /// Reconstruction through the particles as they stand and were sorted.
    pub(super) fn reconstruction(&self) -> Reconstruction<'_, D, M> {
        Reconstruction {
            feet: &self.feet,
            cells: &self.cells,
            method: &self.parts.method,
            terms: &self.terms,
            quadratic: &self.quadratic,
            segments: self.parts.segments,
            grid: self.parts.grid,
            law: &self.parts.law,
            merges: self.merges(),
        }
    }

    pub(super) fn sort_cells(&mut self) {
        let edge = self.feet.finest_spacing(&self.parts.grid);
        self.cells.rebuild(self.feet.positions.iter().copied(), edge);
    }

    /// Moves and renews the foot-points; returns the longest way in spacings.
    ///
    /// 1. Motion. 2. A look at the numbers. 3. What other segments have swept goes. 4. Resampling.
    pub(super) fn advance(&mut self, from: Clock, to: Clock, step: f64, phases: &mut Phases) -> Result<f64, StepError> {
        let clock = phases.clock();
        let start = clock();
        let spacing = self.finest();
        let way = match &self.parts.law {
            Law::Flow(flow) => motion::carry::<D, M>(
                &mut self.feet,
                flow.as_ref(),
                self.parts.integrator,
                (from.time, step),
                spacing,
                &self.parts.interrupt,
            )?,
            Law::Normal { speed } => motion::along_normals(&mut self.feet, speed * step, spacing),
            Law::MeanCurvature => self.by_curvature(step)?,
        };
        self.check_finite(to)?;
        let moved = clock();
        phases.book("front/motion", moved - start);
        self.remove_swept(step)?;
        let swept = clock();
        phases.book("front/topology", swept - moved);
        self.resample()?;
        self.check_finite(to)?;
        phases.book("front/resampling", clock() - swept);
        Ok(way)
    }

    /// An error where a position or a normal is no number.
    fn check_finite(&self, Clock { step, time }: Clock) -> Result<(), StepError> {
        let is_broken = |vectors: &[Vector<D>]| vectors.iter().position(|x| !x.iter().all(|c| c.is_finite()));
        for (field, vectors) in [("position", &self.feet.positions), ("normal", &self.feet.normals)] {
            if let Some(particle) = is_broken(vectors) {
                return Err(StepError::NonFinite { field, particle, step, time });
            }
        }
        Ok(())
    }

    /// Whether segments that run into each other end there. In a flow none can pass another.
    fn merges(&self) -> bool {
        self.parts.topology == Topology::Merge && !matches!(self.parts.law, Law::Flow(_))
    }

    /// Removes what another segment has passed, where segments merge.
    fn remove_swept(&mut self, step: f64) -> Result<(), Interrupted> {
        if !self.merges() {
            return Ok(());
        }
        self.sort_cells();
        let Self { feet, cells, keep, parts, .. } = self;
        let curvatures = &feet.curvatures;
        let way = |i: usize| match parts.law {
            Law::Normal { speed } => speed * step,
            Law::MeanCurvature => -curvatures[i] * step,
            Law::Flow(_) => 0.0,
        };
        mark_unswept(feet, cells, (&parts.method, &parts.grid), &way, keep, &parts.interrupt)?;
        let removed = keep.iter().filter(|keep| !**keep).count();
        if removed > 0 {
            self.removals.swept += removed as u64;
            feet.retain(keep);
        }
        Ok(())
    }

    /// Runge–Kutta stages of dy/dt = −κ n, each with curvatures and normals of reconstructions through the particles of the
    /// stage.
    fn by_curvature(&mut self, step: f64) -> Result<f64, Interrupted> {
        let stages: &[(f64, f64)] = match self.parts.integrator {
            PathIntegrator::TvdRk2 => &[(0.0, 0.5), (1.0, 0.5)],
            _ => &[(0.0, 1.0 / 6.0), (0.5, 1.0 / 3.0), (0.5, 1.0 / 3.0), (1.0, 1.0 / 6.0)],
        };
        let n = self.feet.len();
        self.starts.clear();
        self.starts.extend_from_slice(&self.feet.positions);
        self.slopes.clear();
        self.slopes.resize(n, Vector::<D>::zeros());
        for (k, (offset, weight)) in stages.iter().enumerate() {
            if k > 0 {
                for i in 0..n {
                    let velocity = motion::curvature_velocity(self.feet.curvatures[i], &self.feet.normals[i]);
                    self.feet.positions[i] = self.starts[i] + velocity * (offset * step);
                }
                self.renew_geometry()?;
            }
            for i in 0..n {
                let velocity = motion::curvature_velocity(self.feet.curvatures[i], &self.feet.normals[i]);
                self.slopes[i] += velocity * *weight;
            }
        }
        let mut longest = 0.0_f64;
        for i in 0..n {
            self.feet.positions[i] = self.starts[i] + self.slopes[i] * step;
            longest = longest.max(self.slopes[i].norm());
        }
        Ok(longest * step / self.finest())
    }

    /// Normals and curvatures at the particles where they stand; where a reconstruction fails the last ones stay.
    fn renew_geometry(&mut self) -> Result<(), Interrupted> {
        self.sort_cells();
        self.outcomes.clear();
        self.outcomes.resize(self.feet.len(), Err(Failure::Starved));
        let mut outcomes = std::mem::take(&mut self.outcomes);
        let (positions, interrupt) = (&self.feet.positions, &self.parts.interrupt);
        let place = |i: usize, x: &Vector<D>| (*x, self.parts.grid.spacing_of(self.feet.nodes[i]));
        let filled = fill(&self.reconstruction(), positions, &mut outcomes, &self.rooms, interrupt, place);
        self.outcomes = outcomes;
        filled?;
        for (i, outcome) in self.outcomes.iter().enumerate() {
            if let Ok(foot) = outcome {
                self.feet.normals[i] = foot.normal;
                self.feet.curvatures[i] = foot.curvature;
                self.feet.gauss_curvatures[i] = foot.gauss_curvature;
            }
        }
        Ok(())
    }
}

/// Calls for the grid points within a distance of a surface: boxes of grid points are halved as long as the surface may pass
/// through.
pub(super) fn for_each_near<const D: usize>(
    surface: &dyn Surface<D>,
    radius: f64,
    (grid, level): (&Grid, u32),
    mut visit: impl FnMut(&[i64; D], Vector<D>),
) {
    let (low, high) = surface.bounding_box();
    let spacing = grid.spacing_at(level);
    let margin = radius + spacing;
    let corner = |x: &Vector<D>, side: f64| grid.nearest(&x.add_scalar(side), level);
    let (Some(low), Some(high)) = (corner(&low, -margin), corner(&high, margin)) else { return };
    let mut boxes = vec![(low, high)];
    while let Some((low, high)) = boxes.pop() {
        let (first, last) = (grid.center(&low, level), grid.center(&high, level));
        let center = (first + last) * 0.5;
        let half = 0.5 * (last - first).norm();
        if surface.signed_distance(&center).abs() > half * (1.0 + 1e-12) + radius {
            continue;
        }
        let longest = (0..D).fold(0, |best, d| if high[d] - low[d] > high[best] - low[best] { d } else { best });
        if high[longest] == low[longest] {
            visit(&low, center);
            continue;
        }
        let middle = low[longest] + (high[longest] - low[longest]) / 2;
        let (mut below, mut above) = (high, low);
        below[longest] = middle;
        above[longest] = middle + 1;
        boxes.push((low, below));
        boxes.push((above, high));
    }
}
