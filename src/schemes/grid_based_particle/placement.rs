//! Foot points of a front that starts on known surfaces (GBPM 3.2).

use super::config::FrontConfig;
use super::corners::{for_each_fan, merge_fans};
use super::foot_points::{FootPoint, FootPoints};
use super::grid::{Grid, Node};
use super::refinement::Refinement;
use super::segments::Course;
use super::tube::{GridLevel, for_each_near};
use crate::geometry::{Surface, Vector};

/// Spacing of the outlines along which parameters are measured, relative to the finest spacing.
const OUTLINE_SPACING: f64 = 0.25;

/// A grid point and its foot point.
type Placed<const D: usize> = (Node, FootPoint<D>);

/// The closed parts of a front at the start, and the refined grid.
pub(super) struct Placement<'a, const D: usize, const M: usize> {
    pub surfaces: &'a [Box<dyn Surface<D>>],
    pub config: &'a FrontConfig<D, M>,
    pub refinement: &'a Refinement,
}

impl<const D: usize, const M: usize> Placement<'_, D, M> {
    /// Writes the foot points of all grid points within the tube.
    ///
    /// 1. Each grid point near a part gets the closest point of the part. 2. Where parts share a grid point the nearer one has
    ///    it. 3. Corners that open get fans of particles. 4. Particles get their parameter, where it tells segments apart.
    pub fn place(&self, feet: &mut FootPoints<D>) {
        // Below a level without split cells there are no cells.
        let has_cells = |level: &u32| self.refinement.splits_level(*level);
        let levels = 1 + (0..self.config.method.levels() - 1).take_while(has_cells).count() as u32;
        let mut near: Vec<Placed<D>> = Vec::new();
        for level in 0..levels {
            for (part, surface) in self.surfaces.iter().enumerate() {
                self.place_near(surface.as_ref(), part as u32, level, &mut near);
            }
        }
        let distance = |(node, foot): &Placed<D>| (foot.position - self.config.grid.place::<D>(*node)).norm();
        near.sort_by(|a, b| a.0.cmp(&b.0).then(distance(a).total_cmp(&distance(b))).then(a.1.part.cmp(&b.1.part)));
        near.dedup_by_key(|(node, _)| *node);
        feet.clear();
        for (node, foot) in &near {
            feet.push(*node, foot);
        }
        for level in 0..levels {
            for (part, surface) in self.surfaces.iter().enumerate() {
                self.place_fans(surface.as_ref(), part as u32, level, feet);
            }
        }
        if self.config.segments.parameter.is_some() {
            self.set_parameters(feet);
        }
    }

    /// Adds the grid points of a level near one part, with their closest points.
    fn place_near(&self, surface: &dyn Surface<D>, part: u32, level: u32, near: &mut Vec<Placed<D>>) {
        let grid = self.config.grid;
        let radius = self.config.method.tube_radius * grid.spacing_at(level);
        for_each_near(surface, radius, GridLevel { grid, level }, |at, x| {
            let exact = surface.nearest(&x);
            let is_active = exact.distance.abs() <= radius && self.refinement.is_leaf(at, level);
            if let Some(normal) = exact.normal.filter(|_| is_active) {
                let curvature = exact.curvature.unwrap_or(0.0);
                near.push((Grid::node(at, level), foot_point(exact.point, normal, curvature, part)));
            }
        });
    }

    /// Adds the particles of the corners of one part that open, as far as they lie in cells of a level.
    fn place_fans(&self, surface: &dyn Surface<D>, part: u32, level: u32, feet: &mut FootPoints<D>) {
        let FrontConfig { grid, law, .. } = self.config;
        let mut fans = Vec::new();
        let opens = |distance: f64| law.opens_corners(distance);
        for_each_fan(surface, GridLevel { grid: *grid, level }, opens, |x, normal| fans.push((x, normal)));
        if law.rounds_corners_at_once() {
            fans = merge_fans(fans);
        }
        for (position, normal) in fans {
            let leaf = self.refinement.leaf_at(grid, &position);
            if let Some(node) = leaf.filter(|node| Grid::level(*node) == level) {
                feet.push(node, &foot_point(position, normal, 0.0, part));
            }
        }
    }

    /// Sets the parameter of each particle along the outline of its part.
    fn set_parameters(&self, feet: &mut FootPoints<D>) {
        let spacing = OUTLINE_SPACING * self.config.finest_spacing();
        let surfaces = self.surfaces.iter();
        let courses: Vec<_> = surfaces.map(|surface| Course::from_surface(surface.as_ref(), spacing)).collect();
        for i in 0..feet.len() {
            let course = courses.get(feet.parts[i] as usize).and_then(Option::as_ref);
            feet.parameters[i] = course.map_or(0.0, |course| course.parameter(&feet.positions[i]));
        }
    }
}

/// A foot point at the start, without a Gauss curvature, which surfaces do not tell.
fn foot_point<const D: usize>(position: Vector<D>, normal: Vector<D>, curvature: f64, part: u32) -> FootPoint<D> {
    FootPoint { position, normal, curvature, gauss_curvature: 0.0, part, parameter: 0.0 }
}
