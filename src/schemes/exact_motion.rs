//! The exact motion of a surface in a flow, for errors: the front of many points carried along with tight
//! tolerance, the sign by the backward map.

use crate::geometry::{Domain, Flow, Surface, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{Interrupt, Interrupted};
use crate::time::PathIntegrator;
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};
use std::sync::Arc;

/// A surface and the flow that moves it.
pub struct ExactMotion<const D: usize> {
    surface: Option<Box<dyn Surface<D>>>,
    flow: Arc<dyn Flow<D>>,
}

/// The exact surface at one time.
pub struct ExactFront<'a, const D: usize> {
    motion: &'a ExactMotion<D>,
    surface: &'a dyn Surface<D>,
    time: f64,
    /// The carried surface; None where the surface at this time is known by a formula: at the start, after a return and in a
    /// rigid motion.
    advected: Option<AdvectedFront<D>>,
}

struct AdvectedFront<const D: usize> {
    points: Vec<Vector<D>>,
    /// Whether points k and k + 1 are joined.
    joined: Vec<bool>,
    cells: CellList<D>,
}

/// Tuning constants of exact fronts.
struct ExactTuning {
    /// Integrator of the reference paths; the tolerance is the error of one inner step.
    tight: PathIntegrator,
    /// Integrator of paths whose ends may be rough.
    rough: PathIntegrator,
    /// Distance from the surface beyond which a rough path ends on the right side, in length: a thousand times the error of
    /// such a path in the flows here.
    rough_side: f64,
    /// Integrator of paths for distances to first order.
    nearby: PathIntegrator,
    /// Offset of the points by which the gradient of the backward map is found, in length.
    offset: f64,
    /// Largest number of points of a front.
    most_points: f64,
    /// Points of a front per spacing of the particles, so that the error of its chords stays far below that of the method.
    points_per_spacing: f64,
    /// Edge of the cells for the search of the nearest point of a front, in spacings of the particles.
    cell_edge: f64,
}

const TUNING: ExactTuning = ExactTuning {
    tight: PathIntegrator::Dopri5 { tolerance: 1e-12 },
    rough: PathIntegrator::Dopri5 { tolerance: 1e-7 },
    rough_side: 1e-2,
    nearby: PathIntegrator::Dopri5 { tolerance: 1e-9 },
    offset: 1e-5,
    most_points: 2e5,
    points_per_spacing: 200.0,
    cell_edge: 0.25,
};

/// Spacing of the points of a front, from the extent of its shape.
fn front_spacing(extent: f64, spacing: f64) -> f64 {
    (spacing / TUNING.points_per_spacing).max(4.0 * extent / TUNING.most_points)
}

/// Estimated number of points of a front: that of a circle of this extent.
#[must_use]
pub fn front_points(extent: f64, spacing: f64) -> f64 {
    std::f64::consts::PI * extent / front_spacing(extent, spacing)
}

impl<const D: usize> ExactMotion<D> {
    /// A surface at time 0, where it is known, and its flow.
    #[must_use]
    pub fn new(surface: Option<Box<dyn Surface<D>>>, flow: Arc<dyn Flow<D>>) -> Self {
        Self { surface, flow }
    }

    /// The surface at time 0, where it is known.
    #[must_use]
    pub fn surface(&self) -> Option<&dyn Surface<D>> {
        self.surface.as_deref()
    }

    /// The prescribed flow.
    #[must_use]
    pub fn flow(&self) -> &dyn Flow<D> {
        self.flow.as_ref()
    }

    /// The signed distance of a point close to the surface at a time, to first order: φ(X)/|∇φ(X)|, X the backward map and φ the distance
    /// at the start. In space, where the surface has no outline to carry along.
    #[must_use]
    pub fn distance_nearby(&self, x: &Vector<D>, time: f64) -> Option<f64> {
        let surface = self.surface()?;
        let start = |x: &Vector<D>| surface.signed_distance(&TUNING.nearby.advance(self.flow.as_ref(), x, time, -time));
        let here = start(x);
        let gradient = Vector::<D>::from_fn(|d, _| {
            let mut aside = *x;
            aside[d] += TUNING.offset;
            (start(&aside) - here) / TUNING.offset
        });
        Some(here / gradient.norm())
    }

    /// The approximate position at a time of a point of the surface at the start.
    #[must_use]
    pub fn place_about(&self, start: &Vector<D>, time: f64) -> Vector<D> {
        TUNING.rough.advance(self.flow.as_ref(), start, 0.0, time)
    }

    /// The surface at a time, resolved for particles of a spacing; None where it is not known.
    ///
    /// # Errors
    /// [`Interrupted`] when the run is asked to stop.
    pub fn front(
        &self,
        time: f64,
        spacing: f64,
        interrupt: &Interrupt,
    ) -> Result<Option<ExactFront<'_, D>>, Interrupted> {
        let Some(surface) = self.surface() else { return Ok(None) };
        let by_formula = time == 0.0 || self.flow.is_back(time) || self.flow.is_rigid();
        if by_formula {
            return Ok(Some(ExactFront { motion: self, surface, time, advected: None }));
        }
        let (low, high) = surface.bounding_box();
        let outline = surface.outline(front_spacing((high - low).max(), spacing));
        if outline.is_empty() {
            return Ok(None);
        }
        let starts: Vec<Vector<D>> = outline.iter().flatten().copied().collect();
        let mut joined = Vec::with_capacity(starts.len());
        for chain in &outline {
            joined.extend((0..chain.len()).map(|k| k + 1 < chain.len()));
        }
        let end = |x: &Vector<D>| {
            if interrupt.is_raised() { *x } else { TUNING.tight.advance(self.flow.as_ref(), x, 0.0, time) }
        };
        let points: Vec<Vector<D>> = starts.par_iter().map(end).collect();
        interrupt.check()?;
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(points.iter().copied(), TUNING.cell_edge * spacing);
        let advected = Some(AdvectedFront { points, joined, cells });
        Ok(Some(ExactFront { motion: self, surface, time, advected }))
    }
}

impl<const D: usize> ExactFront<'_, D> {
    /// The front as chains of joined points at most `spacing` apart at the start; none in space.
    #[must_use]
    pub fn chains(&self, spacing: f64) -> Vec<Vec<Vector<D>>> {
        let Some(front) = &self.advected else {
            let mut chains = self.surface.outline(spacing);
            for x in chains.iter_mut().flatten() {
                *x = self.motion.flow.rigid_path(x, self.time).unwrap_or(*x);
            }
            return chains;
        };
        let mut chains = vec![Vec::new()];
        for (x, is_joined) in front.points.iter().zip(&front.joined) {
            if let Some(chain) = chains.last_mut() {
                chain.push(*x);
            }
            if !is_joined {
                chains.push(Vec::new());
            }
        }
        chains.retain(|chain| !chain.is_empty());
        chains
    }

    /// The position at this time of a point of the surface at the start, where that is known by a formula.
    #[must_use]
    pub fn place_by_formula(&self, start: &Vector<D>) -> Option<Vector<D>> {
        let is_known = self.advected.is_none();
        is_known.then(|| self.motion.flow.rigid_path(start, self.time).unwrap_or(*start))
    }

    /// The signed distance of a point from the surface.
    #[must_use]
    pub fn signed_distance(&self, x: &Vector<D>) -> f64 {
        let flow = self.motion.flow.as_ref();
        match &self.advected {
            // A rigid motion keeps distances; every other surface known by a formula is back at its start.
            None => {
                let start = flow.rigid_path(x, -self.time).unwrap_or(*x);
                self.surface.signed_distance(&start)
            }
            Some(front) => {
                let start_distance = |integrator: PathIntegrator| {
                    self.surface.signed_distance(&integrator.advance(flow, x, self.time, -self.time))
                };
                // Only the side matters here; far from the surface a rough path tells it.
                let rough = start_distance(TUNING.rough);
                let side = if rough.abs() > TUNING.rough_side { rough } else { start_distance(TUNING.tight) };
                front.distance(x).copysign(side)
            }
        }
    }
}

impl<const D: usize> AdvectedFront<D> {
    fn distance(&self, x: &Vector<D>) -> f64 {
        let Some((nearest, distance)) = self.cells.nearest(x, f64::INFINITY) else {
            return f64::INFINITY;
        };
        let chord = |k: usize| {
            let (a, b) = (self.points[k], self.points[k + 1]);
            let along = b - a;
            let s = ((x - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (x - (a + along * s)).norm()
        };
        let mut best = distance;
        if self.joined[nearest] {
            best = best.min(chord(nearest));
        }
        if nearest > 0 && self.joined[nearest - 1] {
            best = best.min(chord(nearest - 1));
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::{Arc, ExactMotion, Interrupt};
    use crate::geometry::Vector;
    use crate::geometry::flows::{Rotation, SingleVortex};
    use crate::geometry::surfaces::Ball;

    fn ball() -> Option<Box<dyn crate::geometry::Surface<2>>> {
        Some(Box::new(Ball { center: Vector::<2>::new(0.5, 0.75), radius: 0.15 }))
    }

    #[test]
    fn a_returned_vortex_is_the_start() {
        let motion = ExactMotion::new(ball(), Arc::new(SingleVortex { period: Some(8.0) }));
        let front = motion.front(8.0, 1.0 / 64.0, &Interrupt::default()).unwrap().unwrap();
        assert!((front.signed_distance(&Vector::<2>::new(0.5, 1.0)) - 0.1).abs() < 1e-15);
    }

    #[test]
    fn the_distance_nearby_agrees_with_the_advected_front() {
        let motion = ExactMotion::new(ball(), Arc::new(SingleVortex { period: Some(2.0) }));
        let front = motion.front(0.7, 1.0 / 64.0, &Interrupt::default()).unwrap().unwrap();
        for k in 0..8 {
            let angle = 0.8 * f64::from(k);
            let start = Vector::<2>::new(0.5 + 0.15 * angle.cos(), 0.75 + 0.15 * angle.sin());
            let near = motion.place_about(&start, 0.7) + Vector::<2>::new(3e-4, -2e-4);
            let distance = front.signed_distance(&near);
            let nearby = motion.distance_nearby(&near, 0.7).unwrap();
            assert!((nearby - distance).abs() < 2e-2 * distance.abs() + 1e-6, "{nearby} {distance}");
        }
    }

    #[test]
    fn the_advected_front_agrees_with_a_nearly_returned_one() {
        // Just before the return the surface is displaced by less than 2e-8: speed vanishes with the cosine.
        let motion = ExactMotion::new(ball(), Arc::new(SingleVortex { period: Some(2.0) }));
        let front = motion.front(2.0 - 2e-8, 1.0 / 64.0, &Interrupt::default()).unwrap().unwrap();
        for x in [Vector::<2>::new(0.5, 1.0), Vector::<2>::new(0.42, 0.7), Vector::<2>::new(0.655, 0.75)] {
            let exact = (x - Vector::<2>::new(0.5, 0.75)).norm() - 0.15;
            assert!((front.signed_distance(&x) - exact).abs() < 1e-7);
        }
    }

    #[test]
    fn rigid_motion_is_exact() {
        let rotation = Rotation { center: Vector::<2>::new(0.5, 0.5), angular_velocity: 1.0 };
        let motion = ExactMotion::new(ball(), Arc::new(rotation));
        let front = motion.front(std::f64::consts::FRAC_PI_2, 1.0 / 64.0, &Interrupt::default()).unwrap().unwrap();
        // A quarter turn takes the center to (0.25, 0.5).
        assert!((front.signed_distance(&Vector::<2>::new(0.25, 0.8)) - 0.15).abs() < 1e-10);
    }
}
