//! Patches of a surface, and the search for those that hold the closest point.

use super::Vector;
use super::newton::LocalFoot;
use crate::geometry::box_tree::BoxTree;
use crate::geometry::level::Hessian;

/// A piece of a surface about a seed.
#[derive(Debug, Clone)]
pub(in crate::geometry::surfaces) struct Patch<const D: usize> {
    /// A point of the piece or near it, on the zero of its levels.
    pub seed: Vector<D>,
    /// Whether the seed lies on the surface itself, not only on its levels.
    pub is_on_surface: bool,
    /// Indices of the levels whose common zero the piece is; the first `count` are used.
    pub faces: [u32; D],
    /// Number of these levels.
    pub count: usize,
    /// No point of the piece is farther from the seed.
    pub radius: f64,
    /// No point of the piece is farther from the tangent plane, line or point through the seed.
    pub bulge: f64,
    /// Normal of the first level at the seed.
    pub normal: Vector<D>,
    /// Projection to the normals of all its levels at the seed.
    pub across: Hessian<D>,
}

/// The radius of the piece of a smooth surface in a ball of radius `reach`, about its point nearest to the center, at the
/// distance `offset`; `turn` is the largest curvature times the radius of the ball. A plane has √(reach² − offset²).
pub(in crate::geometry::surfaces) fn radius_in_ball(reach: f64, offset: f64, turn: f64) -> f64 {
    let flat = (reach * reach - offset * offset).max(0.0).sqrt();
    ((1.0 + turn) * flat + MARGIN * reach).min(2.0 * reach)
}

/// Part of a ball's radius that is added to that of a piece in it.
const MARGIN: f64 = 0.02;

impl<const D: usize> Patch<D> {
    /// The levels of the piece.
    pub fn faces(&self) -> &[u32] {
        &self.faces[..self.count]
    }

    /// Whether a closest point of the same levels is the only one about this piece: the piece contains it, or it lies next to it
    /// where the surface is nearly flat and faces the same way.
    fn shares(&self, point: &Vector<D>, normal: &Vector<D>) -> bool {
        let offset = point - self.seed;
        let distance = offset.norm();
        let is_flat = self.count == 1 && self.bulge <= FLAT * self.radius && normal.dot(&self.normal) > 0.7;
        let is_next = || (self.across * offset).norm() <= NEXT * NEXT * self.bulge && distance <= NEXT * self.radius;
        distance <= self.radius || is_flat && is_next()
    }

    /// Whether the piece may hold a local closest point y, where x − y is normal to it: at the seed the part of x − seed along the
    /// piece is no longer than the way to y, and what the normal turns by on it.
    pub fn may_hold_foot(&self, x: &Vector<D>) -> bool {
        let offset = x - self.seed;
        let along = (offset - self.across * offset).norm();
        // As bulges are made of curvatures.
        let turn = (self.bulge / self.radius.max(f64::MIN_POSITIVE) - LEAST_BULGE).max(0.0) / BULGE;
        along <= ROOM * (self.radius + offset.norm() * turn) + 1e-12 * offset.norm()
    }

    /// No point of the piece is nearer to `x`.
    fn least_distance(&self, x: &Vector<D>) -> f64 {
        let offset = x - self.seed;
        let across = (self.across * offset).norm();
        let along = (offset.norm_squared() - across * across).max(0.0).sqrt();
        (along - self.radius).max(0.0).hypot((across - self.bulge).max(0.0))
    }
}

/// A local closest point of a surface.
#[derive(Debug, Clone, Copy)]
pub(in crate::geometry::surfaces) struct Found<const D: usize> {
    /// The point.
    pub foot: LocalFoot<D>,
    /// Its distance, not negative.
    pub distance: f64,
    /// Index of its patch.
    pub patch: usize,
}

/// Bulge of a piece by its curvature times the square of its radius, and the least one by its radius.
pub(in crate::geometry::surfaces) const BULGE: f64 = 0.75;
pub(in crate::geometry::surfaces) const LEAST_BULGE: f64 = 1e-3;
/// Room that is left for what curvatures do not tell.
const ROOM: f64 = 1.3;

/// The patches of a surface in a tree.
#[derive(Debug, Clone)]
pub(in crate::geometry::surfaces) struct PatchSet<const D: usize> {
    patches: Vec<Patch<D>>,
    tree: BoxTree<D>,
}

/// A foot with at least this stretch is the only one near.
const ALONE: f64 = 0.3;
/// Pieces whose bulge is at most this part of their radius are nearly flat.
const FLAT: f64 = 0.1;
/// How far nearly flat surroundings reach, in radii.
const NEXT: f64 = 3.0;

impl<const D: usize> PatchSet<D> {
    /// The patches in a tree.
    pub fn new(patches: Vec<Patch<D>>) -> Self {
        let boxes: Vec<_> =
            patches.iter().map(|p| (p.seed.add_scalar(-p.radius), p.seed.add_scalar(p.radius))).collect();
        let tree = BoxTree::new(&boxes);
        Self { patches, tree }
    }

    /// The patches.
    pub fn patches(&self) -> &[Patch<D>] {
        &self.patches
    }

    /// The corners of the box about all seeds on the surface.
    pub fn extent(&self) -> (Vector<D>, Vector<D>) {
        let mut whole = (Vector::<D>::repeat(f64::INFINITY), Vector::<D>::repeat(f64::NEG_INFINITY));
        for patch in &self.patches {
            whole = (whole.0.inf(&patch.seed), whole.1.sup(&patch.seed));
        }
        whole
    }

    /// The closest point of all patches, and other local ones at most `margin` farther away. `solve` finds the closest point
    /// of one patch, and none where that is not on the surface; it is told whether that may be the closest of all.
    pub fn feet(
        &self,
        x: &Vector<D>,
        margin: f64,
        solve: impl Fn(&Patch<D>, bool) -> Option<LocalFoot<D>>,
    ) -> Vec<Found<D>> {
        let mut bound = f64::INFINITY;
        self.tree.for_each_near(x, bound, |item| {
            let patch = &self.patches[item];
            if patch.is_on_surface {
                bound = bound.min((x - patch.seed).norm());
            }
            bound
        });
        // A bound that was found by rounding must not exclude the patch that it was found by.
        let limit = bound + margin + 1e-12 * (bound + x.amax());
        let mut near = Vec::new();
        self.tree.for_each_near(x, limit, |item| {
            let least = self.patches[item].least_distance(x);
            if least <= limit {
                near.push((least, item));
            }
            limit
        });
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut found: Vec<Found<D>> = Vec::new();
        let mut best = f64::INFINITY;
        for (least, item) in near {
            if least > best + margin {
                break;
            }
            let patch = &self.patches[item];
            let is_known = |known: &Found<D>| {
                let other = &self.patches[known.patch];
                known.foot.stretch >= ALONE
                    && other.faces() == patch.faces()
                    && patch.shares(&known.foot.point, &other.normal)
            };
            if found.iter().any(is_known) {
                continue;
            }
            if let Some(foot) = solve(patch, least <= best) {
                let distance = (x - foot.point).norm();
                best = best.min(distance);
                found.push(Found { foot, distance, patch: item });
            }
        }
        found.retain(|foot| foot.distance <= best + margin);
        found.sort_by(|a, b| a.distance.total_cmp(&b.distance).then(a.patch.cmp(&b.patch)));
        found
    }
}

/// Points that are closer to each other than this share of their distance are the same one.
const SAME_POINT: f64 = 1e-5;

/// The distance of `x` from the medial axis to first order, by its local closest points, the closest first.
///
/// Between two of them the axis lies where the distances agree: (d₂ − d₁)/|∇d₂ − ∇d₁| away. It ends at centers of curvature,
/// (1 + κd)/|κ| away.
pub(in crate::geometry::surfaces) fn medial_distance<const D: usize>(x: &Vector<D>, feet: &[Found<D>]) -> f64 {
    let Some(first) = feet.first() else { return f64::INFINITY };
    let direction = |foot: &Found<D>| (x - foot.foot.point) / foot.distance.max(f64::MIN_POSITIVE);
    let turn = 1.0 - first.foot.stretch;
    let center =
        if turn > 0.0 && turn.is_finite() { first.foot.stretch * first.distance / turn } else { f64::INFINITY };
    feet[1..].iter().fold(center.max(0.0), |least, other| {
        let apart = (direction(other) - direction(first)).norm();
        // The same point, found from another patch: by distances alone a point is told to half the digits.
        let same = SAME_POINT * first.distance + 1e-12 * x.amax();
        if (other.foot.point - first.foot.point).norm() <= same || apart <= 0.0 {
            return least;
        }
        least.min((other.distance - first.distance) / apart)
    })
}
