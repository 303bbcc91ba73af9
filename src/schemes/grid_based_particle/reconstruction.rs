//! The closest point of the front to a place, from a local reconstruction through nearby particles (GBPM 3.3.1 to 3.3.3).

mod fit;
mod trust;
mod tuning;

use super::config::FrontConfig;
use super::foot_points::{FootPoint, FootPoints};
use super::local_graph::{LocalPoint, MOST_ACROSS, Terms};
use crate::geometry::Vector;
use crate::geometry::frame::Frame;
use crate::linear_algebra::least_squares::LeastSquares;
use crate::neighbors::{CellList, Neighbor, NeighborSearch};
use tuning::TUNING;

/// Reason why a place gets no closest point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failure {
    /// Too few particles of one segment are near.
    Starved,
    /// The nearby particles do not determine a polynomial.
    Undetermined,
    /// The closest point lies beyond the particles, or past a corner.
    Extrapolated,
    /// The front turns too sharply for the spacing, or the polynomial does not have the directions of its particles.
    Unresolved,
    /// The closest point lies behind another segment, its particles do not.
    Swept,
}

/// The foot point of a place, or the reason why there is none.
pub(super) type Outcome<const D: usize> = Result<FootPoint<D>, Failure>;

/// Reconstruction of a front through its particles; nothing of it changes while places are served.
pub(super) struct Reconstruction<'a, const D: usize, const M: usize> {
    /// The particles.
    pub feet: &'a FootPoints<D>,
    /// The particles sorted into cells.
    pub cells: &'a CellList<D>,
    /// Method, grid, law and segments.
    pub config: &'a FrontConfig<D, M>,
    /// Terms of the degree of the method.
    pub terms: &'a Terms<M>,
    /// Terms of the quadratic that replaces a higher degree where that fails.
    pub quadratic: &'a Terms<M>,
    /// Whether no fit may reach from the front of another segment to behind it.
    pub merges: bool,
}

/// Storage that one thread uses for all of its reconstructions.
#[derive(Debug)]
pub(super) struct Workspace<const D: usize, const M: usize> {
    /// Particles about the place, nearest first, and the radius in which they were searched.
    near: Vec<Neighbor<D>>,
    search_radius: f64,
    /// First particles of the segments tried so far.
    bases: Vec<usize>,
    /// Particles of a fit.
    chosen: Vec<usize>,
    /// The same particles in local coordinates, and the slopes that their normals ask for.
    points: Vec<LocalPoint<M>>,
    slopes: Vec<Option<[f64; M]>>,
    squares: LeastSquares,
}

impl<const D: usize, const M: usize> Default for Workspace<D, M> {
    fn default() -> Self {
        Self {
            near: Vec::new(),
            search_radius: 0.0,
            bases: Vec::new(),
            chosen: Vec::new(),
            points: Vec::new(),
            slopes: Vec::new(),
            squares: LeastSquares::default(),
        }
    }
}

/// The segment of one particle, as a place sees it.
struct Segment<'a, const D: usize> {
    /// The place whose closest point is wanted.
    place: &'a Vector<D>,
    /// The nearest particle of the segment, at the origin of its fits.
    base: usize,
    /// Unit of length of the fits: the coarser spacing of the place and the base.
    unit: f64,
}

impl<const D: usize, const M: usize> Reconstruction<'_, D, M> {
    /// The closest point of the front to a place, that of a grid point of a level with some spacing or a particle of it.
    ///
    /// 1. Gather the particles about the place, nearest first.
    /// 2. Take the nearest as the base of a segment: the particles whose normals agree with its own.
    /// 3. Fit the segment and find its closest point.
    /// 4. Repeat with the nearest particle of no segment so far, as long as its segment may be nearer. The nearest closest
    ///    point wins.
    ///
    /// # Errors
    /// [`Failure`] of the nearest segment where no segment has a closest point.
    pub fn closest(&self, place: &Vector<D>, spacing: f64, workspace: &mut Workspace<D, M>) -> Outcome<D> {
        self.gather_first(place, spacing, workspace);
        workspace.bases.clear();
        let mut best: Result<(f64, FootPoint<D>), Failure> = Err(Failure::Starved);
        for segment in 0..TUNING.most_segments {
            let bases = &workspace.bases;
            let next = workspace.near.iter().find(|near| !bases.iter().any(|base| self.agrees(*base, near.index)));
            let Some(next) = next.copied() else { break };
            if let Ok((distance, _)) = best
                && next.r2.sqrt() > distance + TUNING.segment_margin * spacing
            {
                break;
            }
            workspace.bases.push(next.index);
            let base = next.index;
            let unit = spacing.max(self.config.grid.spacing_of(self.feet.nodes[base]));
            match self.closest_on_segment(&Segment { place, base, unit }, workspace) {
                Ok(foot) => {
                    let distance = (foot.position - place).norm();
                    if best.as_ref().map_or(true, |(nearest, _)| distance < *nearest) {
                        best = Ok((distance, foot));
                    }
                }
                Err(failure) if segment == 0 => best = Err(failure),
                Err(_) => {}
            }
        }
        best.map(|(_, foot)| foot)
    }

    /// Whether two particles belong to one segment (GBPM 3.3.2).
    pub fn agrees(&self, i: usize, j: usize) -> bool {
        self.config.segments.match_labels(self.feet, i, j)
            && self.feet.normals[i].dot(&self.feet.normals[j]) > self.config.method.cosine
    }

    /// Gathers the particles about a place. About a new grid point of a finer level there are those of the coarser one.
    fn gather_first(&self, place: &Vector<D>, spacing: f64, workspace: &mut Workspace<D, M>) {
        let first = self.config.method.tube_radius + TUNING.first_search[M - 1];
        workspace.search_radius = first * spacing;
        self.gather(place, workspace);
        while workspace.near.is_empty() && workspace.search_radius < first * self.config.grid.spacing {
            workspace.search_radius *= TUNING.search_growth;
            self.gather(place, workspace);
        }
    }

    /// Gathers the particles within the radius of the search.
    fn gather(&self, place: &Vector<D>, workspace: &mut Workspace<D, M>) {
        self.cells.gather(place, workspace.search_radius, &mut workspace.near);
        workspace.near.sort_unstable_by(|a, b| a.r2.total_cmp(&b.r2).then(a.index.cmp(&b.index)));
    }

    /// Chooses particles of a segment, nearest first, each at some distance from those chosen before.
    fn choose(&self, segment: &Segment<'_, D>, number: usize, workspace: &mut Workspace<D, M>) {
        let base = segment.base;
        let least = (self.config.method.min_separation * segment.unit).powi(2);
        let chosen = &mut workspace.chosen;
        chosen.clear();
        chosen.push(base);
        for near in &workspace.near {
            if chosen.len() >= number {
                return;
            }
            let x = &self.feet.positions[near.index];
            let is_apart = |j: &usize| (self.feet.positions[*j] - x).norm_squared() >= least;
            if near.index != base && self.agrees(base, near.index) && chosen.iter().all(is_apart) {
                chosen.push(near.index);
            }
        }
    }

    /// Chooses particles of a segment, from farther away where too few are near.
    fn search(&self, segment: &Segment<'_, D>, number: usize, workspace: &mut Workspace<D, M>) {
        loop {
            self.choose(segment, number, workspace);
            let is_farthest =
                workspace.search_radius * TUNING.search_growth > self.config.law.farthest_search() * segment.unit;
            if workspace.chosen.len() >= number || is_farthest {
                return;
            }
            workspace.search_radius *= TUNING.search_growth;
            self.gather(segment.place, workspace);
        }
    }

    /// The closest point of one segment.
    ///
    /// Where the particles do not determine the polynomial well (on two rows of a lattice, for example) more are taken, and
    /// then a quadratic is fitted. Where the law asks for it, a bend that the particles do not resolve gets a quadratic through
    /// the nearest of them at once.
    fn closest_on_segment(&self, segment: &Segment<'_, D>, workspace: &mut Workspace<D, M>) -> Outcome<D> {
        let (mut terms, mut least) = (self.terms, self.config.method.neighbors);
        self.search(segment, least, workspace);
        let is_wide = terms.count() > self.quadratic.count();
        if let Some(number) = self.config.law.particles_in_bends().filter(|_| is_wide)
            && self.least_cosine(segment.base, &workspace.chosen) < TUNING.least_cosine_in_bends[M - 1]
        {
            (terms, least) = (self.quadratic, number);
            workspace.chosen.truncate(least);
        }
        let mut number = least;
        loop {
            let found = self.closest_of_chosen(segment, terms, workspace);
            number += least.div_ceil(2);
            if found != Err(Failure::Undetermined) {
                return found;
            }
            if number > 2 * least {
                break;
            }
            self.search(segment, number, workspace);
        }
        if terms.count() == self.quadratic.count() {
            return Err(Failure::Undetermined);
        }
        // At the end of a segment the particles of one side still determine a quadratic.
        self.search(segment, least, workspace);
        self.closest_of_chosen(segment, self.quadratic, workspace)
    }

    /// The least cosine between the normal of the base and those of the particles of a fit.
    fn least_cosine(&self, base: usize, chosen: &[usize]) -> f64 {
        let normals = &self.feet.normals;
        chosen.iter().map(|j| normals[*j].dot(&normals[base])).fold(1.0, f64::min)
    }

    /// The closest point by the chosen particles: over the normal of the base, and where the front turns or that fit fails, by
    /// a quadratic over the mean normal.
    fn closest_of_chosen(
        &self,
        segment: &Segment<'_, D>,
        terms: &Terms<M>,
        workspace: &mut Workspace<D, M>,
    ) -> Outcome<D> {
        if workspace.chosen.len() < self.quadratic.count() {
            return Err(Failure::Starved);
        }
        let normals = &self.feet.normals;
        let mut first = Err(Failure::Unresolved);
        if self.least_cosine(segment.base, &workspace.chosen) > TUNING.least_cosine_of_full_degree {
            first = self.fit(segment, &normals[segment.base], terms, workspace);
            if first.is_ok() || first == Err(Failure::Undetermined) {
                return first;
            }
        }
        let mean: Vector<D> = workspace.chosen.iter().map(|j| normals[*j]).sum();
        let Some(mean) = mean.try_normalize(0.1) else { return first };
        self.fit(segment, &mean, self.quadratic, workspace).or(first)
    }

    /// The closest point by one fit over the frame of a direction.
    fn fit(
        &self,
        segment: &Segment<'_, D>,
        direction: &Vector<D>,
        terms: &Terms<M>,
        workspace: &mut Workspace<D, M>,
    ) -> Outcome<D> {
        if D - M == 1 {
            self.fit_over::<1>(segment, &Frame::from_normal(direction), terms, workspace)
        } else {
            self.fit_over::<MOST_ACROSS>(segment, &Frame::from_tangent(direction), terms, workspace)
        }
    }
}

#[cfg(test)]
mod tests;
