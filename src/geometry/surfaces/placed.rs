//! Shapes that are rotated, scaled and moved.

use super::{Surface, SurfacePoint, Vector};
use crate::geometry::level::{Hessian, LevelFunction, LevelJet};
use std::sync::Arc;

/// The map x → s R x + t of a rotation R about the origin, a scale s and a translation t, in this order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement<const D: usize> {
    /// The orthogonal matrix R.
    pub rotation: Hessian<D>,
    /// The scale s > 0.
    pub scale: f64,
    /// The translation t.
    pub shift: Vector<D>,
}

impl<const D: usize> Placement<D> {
    /// The rotation matrix of an angle in rad: counterclockwise in the plane, about a unit vector by the right-hand rule in
    /// space (Rodrigues' formula).
    #[must_use]
    pub fn rotation(angle: f64, axis: &Vector<D>) -> Hessian<D> {
        let (sin, cos) = angle.sin_cos();
        Hessian::<D>::from_fn(|i, j| {
            let same = if i == j { 1.0 } else { 0.0 };
            if D == 2 {
                let sign = if i < j { -1.0 } else { 1.0 };
                return if i == j { cos } else { sign * sin };
            }
            // ε_ijk a_k with k the third axis.
            let third = (2 * D - i - j) % D;
            let cyclic = if (i + 1) % D == j { -1.0 } else { 1.0 };
            let cross = if i == j { 0.0 } else { cyclic * axis[third] };
            cos * same + sin * cross + (1.0 - cos) * axis[i] * axis[j]
        })
    }

    fn apply(&self, x: &Vector<D>) -> Vector<D> {
        self.rotation * x * self.scale + self.shift
    }

    fn undo(&self, x: &Vector<D>) -> Vector<D> {
        self.rotation.transpose() * ((x - self.shift) / self.scale)
    }
}

/// A surface that is rotated, scaled and moved.
pub struct Placed<const D: usize> {
    /// The surface in its own coordinates.
    pub surface: Arc<dyn Surface<D>>,
    /// The map from these coordinates.
    pub placement: Placement<D>,
}

impl<const D: usize> Surface<D> for Placed<D> {
    fn nearest(&self, x: &Vector<D>) -> SurfacePoint<D> {
        let Placement { rotation, scale, .. } = &self.placement;
        let answer = self.surface.nearest(&self.placement.undo(x));
        SurfacePoint {
            distance: answer.distance * scale,
            point: self.placement.apply(&answer.point),
            normal: answer.normal.map(|normal| rotation * normal),
            curvature: answer.curvature.map(|curvature| curvature / scale),
        }
    }

    fn bounding_box(&self) -> (Vector<D>, Vector<D>) {
        let (low, high) = self.surface.bounding_box();
        let middle = self.placement.apply(&((low + high) * 0.5));
        let half = self.placement.rotation.abs() * ((high - low) * (0.5 * self.placement.scale));
        (middle - half, middle + half)
    }

    fn area_or_volume(&self) -> f64 {
        self.surface.area_or_volume() * self.placement.scale.powi(D as i32)
    }

    fn near_medial_axis(&self, x: &Vector<D>, tolerance: f64) -> bool {
        self.surface.near_medial_axis(&self.placement.undo(x), tolerance / self.placement.scale)
    }

    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<D>>> {
        let mut chains = self.surface.outline(spacing / self.placement.scale);
        chains.iter_mut().flatten().for_each(|x| *x = self.placement.apply(x));
        chains
    }

    fn signed_distance(&self, x: &Vector<D>) -> f64 {
        self.surface.signed_distance(&self.placement.undo(x)) * self.placement.scale
    }

    fn faces(&self) -> Option<Vec<Arc<dyn LevelFunction<D>>>> {
        let placed =
            |level| -> Arc<dyn LevelFunction<D>> { Arc::new(PlacedLevel { level, placement: self.placement }) };
        Some(self.surface.faces()?.into_iter().map(placed).collect())
    }
}

/// A level s f(Rᵀ (x − t)/s), a distance where f is one.
struct PlacedLevel<const D: usize> {
    level: Arc<dyn LevelFunction<D>>,
    placement: Placement<D>,
}

impl<const D: usize> LevelFunction<D> for PlacedLevel<D> {
    fn value(&self, x: &Vector<D>) -> f64 {
        self.level.value(&self.placement.undo(x)) * self.placement.scale
    }

    fn jet(&self, x: &Vector<D>) -> LevelJet<D> {
        let Placement { rotation, scale, .. } = &self.placement;
        let jet = self.level.jet(&self.placement.undo(x));
        LevelJet {
            value: jet.value * scale,
            gradient: rotation * jet.gradient,
            hessian: rotation * jet.hessian * rotation.transpose() / *scale,
        }
    }
}
