//! Whether the closest point of a fit can be trusted.

use super::{Failure, Reconstruction, Segment, TUNING, Workspace};
use crate::geometry::Vector;
use crate::geometry::frame::Frame;
use crate::neighbors::Neighbor;
use crate::schemes::grid_based_particle::local_graph::LocalGraph;
use crate::schemes::grid_based_particle::local_shape::LocalShape;
use crate::schemes::grid_based_particle::sweep::{height_over, may_pass};

impl<const D: usize, const M: usize> Reconstruction<'_, D, M> {
    /// Fails where the closest point lies too far beyond the particles of the fit. Where particles are exact by themselves the
    /// last ones are the ends of their segments, corners and tips, and nothing lies beyond them.
    pub(super) fn check_extrapolation(&self, beyond: f64) -> Result<(), Failure> {
        let most = if self.config.law.keeps_particles_exact() { 0.0 } else { TUNING.most_extrapolation };
        if beyond > most { Err(Failure::Extrapolated) } else { Ok(()) }
    }

    /// Fails where the front is too sharp for the spacing, and where the graph has folded.
    pub(super) fn check_shape(&self, shape: &LocalShape<D>, base: usize) -> Result<(), Failure> {
        let is_sharp = shape.sharpest > TUNING.sharpest || shape.sharpest.is_nan();
        if is_sharp || shape.direction.dot(&self.feet.normals[base]) < TUNING.least_agreement {
            return Err(Failure::Unresolved);
        }
        Ok(())
    }

    /// Fails where no particle of the fit is near the closest point, and where it lies past a corner in a flow.
    pub(super) fn check_support(
        &self,
        segment: &Segment<'_, D>,
        position: &Vector<D>,
        is_beyond: bool,
        workspace: &Workspace<D, M>,
    ) -> Result<(), Failure> {
        let unit = segment.unit;
        let most = if is_beyond { TUNING.most_lonely } else { self.config.law.widest_bridge() };
        let square = |j: usize| (self.feet.positions[j] - position).norm_squared();
        let is_nearer = |a: &usize, b: &usize| square(*a).total_cmp(&square(*b));
        let nearest = workspace.chosen.iter().copied().min_by(is_nearer).unwrap_or(segment.base);
        let is_lonely = square(nearest) > (most * unit).powi(2);
        if is_lonely
            || (self.config.law.keeps_particles_exact()
                && self.is_past_corner(nearest, position, unit, &workspace.chosen))
        {
            return Err(Failure::Extrapolated);
        }
        Ok(())
    }

    /// Whether a place lies ahead of the last particle of its segment at a corner, where the front continues around the corner:
    /// such a place is an opening, which no fit may bridge.
    fn is_past_corner(&self, last: usize, place: &Vector<D>, unit: f64, chosen: &[usize]) -> bool {
        let test = TUNING.corner;
        let cosine_of_segment = self.config.method.cosine;
        let (x, n) = (&self.feet.positions[last], &self.feet.normals[last]);
        let way = place - x;
        let length = way.norm();
        let is_ahead = |j: usize| {
            let d = self.feet.positions[j] - x;
            let (along, square) = (d.dot(&way), d.norm_squared());
            let is_on_the_way = test.cone * along * along >= square * length * length;
            along > 0.0 && is_on_the_way && square <= (test.ahead * unit).powi(2)
        };
        if length < test.same_place * unit || chosen.iter().any(|j| is_ahead(*j)) {
            return false;
        }
        let order = self.cells.permutation();
        let cosine = |place: usize| self.feet.normals[order[place]].dot(n);
        let goes_on = |place: usize| is_ahead(order[place]) && self.agrees(last, order[place]);
        let is_other_side = |place: usize| test.opposite < cosine(place) && cosine(place) <= cosine_of_segment;
        // The tip of a filament has all directions, a corner those of its sides alone. The edge of a sheet counts as one.
        let is_between = |place: usize| cosine_of_segment < cosine(place) && cosine(place) < test.straight;
        !self.cells.any_within(x, test.ahead * unit, goes_on)
            && self.cells.any_within(x, test.other_side * unit, is_other_side)
            && (M > 1 || !self.cells.any_within(x, test.other_side * unit, is_between))
    }

    /// Fails where the graph does not have the directions of its particles, if particles are exact by themselves: a graph
    /// through both sides of a sharp tip, or across a gap, is not the front.
    pub(super) fn check_directions<const C: usize>(
        &self,
        frame: &Frame<D, M, C>,
        graphs: &[LocalGraph<'_, M>; C],
        workspace: &Workspace<D, M>,
    ) -> Result<(), Failure> {
        let is_exact = self.config.law.keeps_particles_exact();
        if is_exact && self.misfit(frame, graphs, workspace) > TUNING.most_misfit[M - 1] {
            return Err(Failure::Unresolved);
        }
        Ok(())
    }

    /// √(Σ w |n_graph − n|² / Σ w) over the particles of a fit, with its weights w.
    fn misfit<const C: usize>(
        &self,
        frame: &Frame<D, M, C>,
        graphs: &[LocalGraph<'_, M>; C],
        workspace: &Workspace<D, M>,
    ) -> f64 {
        let (mut sum, mut weights) = (0.0, 0.0);
        for (j, (s, _)) in workspace.chosen.iter().zip(&workspace.points) {
            let weight = (-self.config.method.weight * s.iter().map(|s| s * s).sum::<f64>()).exp();
            let jets = std::array::from_fn(|c| graphs[c].jet(s));
            sum += weight * (LocalShape::new(frame, &jets).direction - self.feet.normals[*j]).norm_squared();
            weights += weight;
        }
        (sum / weights).sqrt()
    }

    /// Whether another segment lies between a particle and a place on its own segment.
    pub(super) fn passes_another(&self, base: usize, place: &Vector<D>, near: &[Neighbor<D>]) -> bool {
        let start = &self.feet.positions[base];
        let cosine = self.config.method.cosine;
        near.iter().map(|near| near.index).filter(|j| may_pass(self.feet, base, *j, cosine)).any(|j| {
            let spacing = self.config.grid.spacing_of(self.feet.nodes[j]);
            let facing = self.config.law.facing(self.feet, j);
            let ahead = |x| height_over(self.feet, j, x, spacing).map(|height| height * facing);
            let (Some(from), Some(to)) = (ahead(start), ahead(place)) else { return false };
            let tolerance = TUNING.on_segment * spacing;
            from >= -tolerance && to < -tolerance && to < from
        })
    }
}
