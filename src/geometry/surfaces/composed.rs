//! Intersections and differences of shapes, with exact distances at the edges and corners where their surfaces meet.
//!
//! The level of a solid is the largest or smallest of the signed distances of its shapes. No surface is nearer than its
//! absolute value says. Where the closest point of the shape that gives this value lies on the solid, it is the closest
//! point. Elsewhere it lies on an edge or a corner, or on a part of a face that is only locally closest: these come from
//! patches of the faces and of the sets where two or three faces meet.

mod outline;
mod tree;

use super::distance_level::DistanceLevel;
use super::sampled::line_volume::line_volume;
use super::sampled::{
    BULGE, Found, LEAST_BULGE, LocalFoot, Patch, PatchSet, local_foot, medial_distance, radius_in_ball,
};
use super::{Solid, Surface, SurfacePoint, Vector};
use crate::geometry::block::indices;
use crate::geometry::level::{Hessian, LevelFunction, LevelJet};
use std::sync::{Arc, OnceLock};
use tree::Node;

/// Tuning constants, for the plane and for space.
struct ComposedTuning {
    /// Cells along the longest side of the solid's box, before they are halved.
    first_cells: [usize; 2],
    /// Halvings of all cells that may hold a part of the surface.
    halvings: [u32; 2],
    /// Halvings beyond, where a face turns within a cell or many meet.
    more_halvings: [u32; 2],
    /// Largest turn of a face within half the diagonal of a cell, in rad.
    turn: f64,
    /// Faces in a cell that is not halved further.
    faces_in_cell: usize,
    /// Distance from the solid's surface that is round-off, relative to the size.
    on_surface: f64,
    /// Distance of the places that tell whether the inside lies on one side of a point alone, relative to the size.
    aside: f64,
}

const TUNING: ComposedTuning = ComposedTuning {
    first_cells: [32, 12],
    halvings: [2, 2],
    more_halvings: [6, 3],
    turn: 0.3,
    faces_in_cell: 4,
    on_surface: 1e-12,
    aside: 1e-6,
};

/// A solid without points, or without a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("nothing is left of the shape: its members leave no common part; move or resize them")]
pub struct EmptySolid;

/// A smooth face, and the shape that it belongs to.
struct Face<const D: usize> {
    level: Arc<dyn LevelFunction<D>>,
    shape: usize,
}

/// A shape of the solid.
struct Member<const D: usize> {
    surface: Arc<dyn Surface<D>>,
    /// 1, or −1 where the outside of the shape counts.
    sign: f64,
}

/// The surface of a solid that is composed of several shapes.
pub struct Composed<const D: usize> {
    tree: Node,
    members: Vec<Member<D>>,
    faces: Vec<Face<D>>,
    patches: PatchSet<D>,
    /// Lower and upper corner of a box that contains the surface.
    corners: (Vector<D>, Vector<D>),
    /// The length that tolerances are relative to.
    size: f64,
    area_or_volume: OnceLock<f64>,
}

impl<const D: usize> Composed<D> {
    /// The surface of a solid.
    ///
    /// # Errors
    /// [`EmptySolid`] where no surface is found: parts thinner than round-off are no parts.
    pub fn new(solid: &Solid<D>) -> Result<Self, EmptySolid> {
        let mut members = Vec::new();
        let tree = Node::new(solid, false, &mut members);
        let mut faces = Vec::new();
        for (shape, member) in members.iter().enumerate() {
            let own = || -> Vec<Arc<dyn LevelFunction<D>>> {
                vec![Arc::new(DistanceLevel::new(Arc::clone(&member.surface)))]
            };
            let levels = member.surface.faces().unwrap_or_else(own);
            faces.extend(levels.into_iter().map(|level| Face { level, shape }));
        }
        let corners = tree.bounding_box(&members);
        let size = corners.0.amax().max(corners.1.amax());
        let empty = PatchSet::new(Vec::new());
        let mut found = Self { tree, members, faces, patches: empty, corners, size, area_or_volume: OnceLock::new() };
        let mut patches = Vec::new();
        let sides = corners.1 - corners.0;
        let edge = sides.max() / TUNING.first_cells[D - 2] as f64;
        if !(edge > 0.0 && edge.is_finite()) {
            return Err(EmptySolid);
        }
        // A little more than the box, so that no face lies on the sides of cells.
        let counts: [usize; D] = std::array::from_fn(|d| (sides[d] / edge + 0.5).ceil() as usize + 1);
        let all: Vec<u32> = (0..found.faces.len() as u32).collect();
        for k in 0..counts.iter().product::<usize>() {
            let cell = indices(k, &counts);
            let center = Vector::<D>::from_fn(|d, _| corners.0[d] + (cell[d] as f64 + 0.5 - 0.339) * edge);
            found.add_patches(&center, 0.5 * edge, 0, &all, &mut patches);
        }
        if !patches.iter().any(|patch| patch.is_on_surface) {
            return Err(EmptySolid);
        }
        found.patches = PatchSet::new(patches);
        found.corners = found.tight_box();
        Ok(found)
    }

    /// The level of the solid, and the shape that gives it.
    fn level(&self, x: &Vector<D>) -> (f64, usize) {
        self.tree.level(x, &self.members)
    }

    /// Whether a point where the faces with these normals are zero lies on the surface of the solid: its level is zero, and
    /// both inside and outside lie next to it.
    fn is_on_surface(&self, y: &Vector<D>, normals: &[Vector<D>]) -> bool {
        if self.level(y).0.abs() > TUNING.on_surface * self.size {
            return false;
        }
        let (mut has_inside, mut has_outside) = (false, false);
        for signs in 0..1_usize << normals.len() {
            let signed = |(k, n): (usize, &Vector<D>)| if signs >> k & 1 == 1 { *n } else { -*n };
            let aside: Vector<D> = normals.iter().enumerate().map(signed).sum();
            let level = self.level(&(y + aside * (TUNING.aside * self.size))).0;
            has_inside |= level < 0.0;
            has_outside |= level > 0.0;
        }
        has_inside && has_outside
    }

    /// [`Self::is_on_surface`] for a point of some faces.
    fn is_on_surface_by_faces(&self, y: &Vector<D>, faces: &[u32]) -> bool {
        let mut normals = [Vector::<D>::zeros(); D];
        for (normal, face) in normals.iter_mut().zip(faces) {
            *normal = self.faces[*face as usize].level.jet(y).normal();
        }
        self.is_on_surface(y, &normals[..faces.len()])
    }

    /// Adds the patches of a cube, halving it where its faces need that. `near` are the faces that may pass through it.
    fn add_patches(&self, center: &Vector<D>, half: f64, depth: u32, near: &[u32], patches: &mut Vec<Patch<D>>) {
        let reach = half * (D as f64).sqrt();
        if self.level(center).0.abs() > reach {
            return;
        }
        let is_near = |face: &&u32| {
            let jet = self.faces[**face as usize].level.jet(center);
            // Levels that are no distances are known to first and second order.
            jet.value.abs() <= 1.05 * jet.gradient.norm() * reach + 0.5 * jet.hessian.norm() * reach * reach
        };
        let near: Vec<u32> = near.iter().filter(is_near).copied().collect();
        let halvings = TUNING.halvings[D - 2];
        let is_turning = |face: &u32| {
            let level = self.faces[*face as usize].level.as_ref();
            let foot = local_foot(&[level], center, center, reach);
            foot.is_some_and(|foot| {
                let is_here = (foot.point - center).norm() <= reach;
                is_here && level.jet(&foot.point).sharpest_curvature() * reach > TUNING.turn
            })
        };
        let is_last = depth >= halvings + TUNING.more_halvings[D - 2];
        let needs_halving = || near.len() > TUNING.faces_in_cell || near.iter().any(is_turning);
        if depth < halvings || !is_last && needs_halving() {
            let quarter = 0.5 * half;
            for corner in 0..1_usize << D {
                let offset = |d: usize| if corner >> d & 1 == 1 { quarter } else { -quarter };
                let center = Vector::<D>::from_fn(|d, _| center[d] + offset(d));
                self.add_patches(&center, quarter, depth + 1, &near, patches);
            }
            return;
        }
        let known = patches.len();
        for count in 1..=D.min(near.len()) {
            for_each_choice(near.len(), count, |chosen| {
                let mut faces = [0; D];
                for (face, k) in faces.iter_mut().zip(chosen) {
                    *face = near[*k];
                }
                patches.extend(self.patch(center, reach, (faces, count), near.len() > count));
            });
        }
        // Where shapes share a face, the level may be zero without a side that is inside.
        let is_sound = patches[known..].iter().any(|patch| patch.is_on_surface) || self.changes_sign(center, half);
        if !is_sound {
            patches.truncate(known);
        }
    }

    /// Whether the corners of a cube lie inside and outside.
    fn changes_sign(&self, center: &Vector<D>, half: f64) -> bool {
        let is_inside = |corner: usize| {
            let offset = |d: usize| if corner >> d & 1 == 1 { half } else { -half };
            self.level(&Vector::<D>::from_fn(|d, _| center[d] + offset(d))).0 < 0.0
        };
        let first = is_inside(0);
        (1..1_usize << D).any(|corner| is_inside(corner) != first)
    }

    /// The patch of the common zero of faces in a ball about a cell; None where there is none.
    fn patch(
        &self,
        center: &Vector<D>,
        reach: f64,
        (faces, count): ([u32; D], usize),
        has_others: bool,
    ) -> Option<Patch<D>> {
        let seed = self.local_foot(&faces[..count], center, center, reach)?.point;
        if (seed - center).norm() > 1.001 * reach {
            return None;
        }
        let is_on_surface = self.is_on_surface_by_faces(&seed, &faces[..count]);
        // Another face may cut the set so that its seed is off the solid, but not all of it.
        if !is_on_surface && (count == D || !has_others) {
            return None;
        }
        let jets: Vec<LevelJet<D>> = faces[..count].iter().map(|f| self.faces[*f as usize].level.jet(&seed)).collect();
        let across = projection(&jets);
        let curvature: f64 = jets.iter().map(LevelJet::sharpest_curvature).sum::<f64>() / least_sine(&jets);
        let turn = curvature * reach;
        let radius = if count == D { 0.0 } else { radius_in_ball(reach, (seed - center).norm(), turn) };
        let bulge = (BULGE * curvature * radius * radius).min(radius) + LEAST_BULGE * radius;
        let normal = jets[0].normal();
        Some(Patch { seed, is_on_surface, faces, count, radius, bulge, normal, across })
    }

    fn local_foot(&self, faces: &[u32], x: &Vector<D>, start: &Vector<D>, reach: f64) -> Option<LocalFoot<D>> {
        let mut levels: [&dyn LevelFunction<D>; D] = [self.faces[0].level.as_ref(); D];
        for (level, face) in levels.iter_mut().zip(faces) {
            *level = self.faces[*face as usize].level.as_ref();
        }
        local_foot(&levels[..faces.len()], x, start, reach)
    }

    /// The closest point by patches, and other local ones at most `margin` farther away.
    fn feet(&self, x: &Vector<D>, margin: f64) -> Vec<Found<D>> {
        let solve = |patch: &Patch<D>, _: bool| {
            if patch.count == D {
                return Some(LocalFoot { point: patch.seed, stretch: f64::INFINITY, is_smooth: true });
            }
            if !patch.may_hold_foot(x) {
                return None;
            }
            self.local_foot(patch.faces(), x, &patch.seed, patch.radius)
                .filter(|foot| self.is_on_surface_by_faces(&foot.point, patch.faces()))
        };
        self.patches.feet(x, margin, solve)
    }

    /// The answer where the closest point of the shape that gives the level lies on the solid and on no other shape.
    fn nearest_of_shape(&self, x: &Vector<D>) -> Result<SurfacePoint<D>, f64> {
        let (level, shape) = self.level(x);
        let member = &self.members[shape];
        let answer = member.surface.nearest(x);
        let Some(normal) = answer.normal.filter(|normal| self.is_on_surface(&answer.point, &[*normal])) else {
            return Err(level);
        };
        let touch = TUNING.on_surface * self.size;
        let is_alone =
            |(k, other): (usize, &Member<D>)| k == shape || other.surface.signed_distance(&answer.point).abs() > touch;
        if !self.members.iter().enumerate().all(is_alone) {
            return Err(level);
        }
        let (normal, curvature) = (normal * member.sign, answer.curvature.map(|curvature| curvature * member.sign));
        Ok(SurfacePoint { distance: level, point: answer.point, normal: Some(normal), curvature })
    }

    /// The box of the seeds on the surface and what may lie between them, within that of the shapes.
    fn tight_box(&self) -> (Vector<D>, Vector<D>) {
        let mut whole = (Vector::<D>::repeat(f64::INFINITY), Vector::<D>::repeat(f64::NEG_INFINITY));
        for patch in self.patches.patches() {
            // The box of a piece of a tangent plane, line or point.
            let along = |d: usize| patch.radius * (1.0 - patch.across[(d, d)]).max(0.0).sqrt() + patch.bulge;
            let half = Vector::<D>::from_fn(|d, _| along(d));
            whole = (whole.0.inf(&(patch.seed - half)), whole.1.sup(&(patch.seed + half)));
        }
        (whole.0.sup(&self.corners.0), whole.1.inf(&self.corners.1))
    }
}

impl<const D: usize> Surface<D> for Composed<D> {
    fn nearest(&self, x: &Vector<D>) -> SurfacePoint<D> {
        let level = match self.nearest_of_shape(x) {
            Ok(answer) => return answer,
            Err(level) => level,
        };
        let feet = self.feet(x, 0.0);
        let Some(first) = feet.first() else {
            return SurfacePoint { distance: f64::NAN, point: *x, normal: None, curvature: None };
        };
        let nothing = SurfacePoint {
            distance: first.distance.copysign(level),
            point: first.foot.point,
            normal: None,
            curvature: None,
        };
        let patch = &self.patches.patches()[first.patch];
        if patch.count > 1 {
            return nothing;
        }
        let member = &self.members[self.faces[patch.faces[0] as usize].shape];
        let answer = member.surface.nearest(&first.foot.point);
        SurfacePoint {
            normal: answer.normal.map(|normal| normal * member.sign),
            curvature: answer.curvature.map(|curvature| curvature * member.sign),
            ..nothing
        }
    }

    fn bounding_box(&self) -> (Vector<D>, Vector<D>) {
        self.corners
    }

    fn area_or_volume(&self) -> f64 {
        *self.area_or_volume.get_or_init(|| {
            if D == 2 {
                outline::area(self).abs()
            } else {
                let volume = line_volume(&|x: &Vector<D>| self.level(x).0, &self.corners.0, &self.corners.1);
                // Of a solid without bounds, that of its complement.
                let beyond = self.corners.1 + (self.corners.1 - self.corners.0);
                if self.level(&beyond).0 < 0.0 { (self.corners.1 - self.corners.0).product() - volume } else { volume }
            }
        })
    }

    fn near_medial_axis(&self, x: &Vector<D>, tolerance: f64) -> bool {
        medial_distance(x, &self.feet(x, 2.0 * tolerance)) <= tolerance
    }

    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<D>>> {
        outline::chains(self, spacing)
    }

    fn signed_distance(&self, x: &Vector<D>) -> f64 {
        self.nearest(x).distance
    }
}

/// Calls `visit` with each choice of `count` of `most` indices, in ascending order.
fn for_each_choice(most: usize, count: usize, mut visit: impl FnMut(&[usize])) {
    let mut chosen: Vec<usize> = (0..count).collect();
    loop {
        visit(&chosen);
        let Some(place) = (0..count).rev().find(|k| chosen[*k] < most - count + k) else { return };
        chosen[place] += 1;
        for k in place + 1..count {
            chosen[k] = chosen[k - 1] + 1;
        }
    }
}

/// Projection to the span of the normals of levels.
fn projection<const D: usize>(jets: &[LevelJet<D>]) -> Hessian<D> {
    let mut whole = Hessian::<D>::zeros();
    for jet in jets {
        let normal = jet.normal();
        let rest = normal - whole * normal;
        if let Some(next) = rest.try_normalize(1e-9) {
            whole += next * next.transpose();
        }
    }
    whole
}

/// The least sine between normals of levels, not below a hundredth.
fn least_sine<const D: usize>(jets: &[LevelJet<D>]) -> f64 {
    let mut least = 1.0_f64;
    for (k, a) in jets.iter().enumerate() {
        for b in &jets[..k] {
            let cos = a.normal().dot(&b.normal());
            least = least.min((1.0 - cos * cos).max(0.0).sqrt());
        }
    }
    least.max(1e-2)
}
