//! The exact motion of a surface in a flow, for errors: the front of many points carried along with tight
//! tolerance, the sign by the backward map.

use crate::geometry::{Domain, Flow, Surface, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{Interrupt, Interrupted};
use crate::time::PathIntegrator;
use crate::time::integrators::PATHS;
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSlice, ParallelSliceMut};
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

    /// Signed distances of points close to the surface at a time, to first order: φ(X)/|∇φ(X)|, X the backward map and φ the distance
    /// at the start. In space, where the surface has no outline to carry along. None where the surface is not known.
    ///
    /// # Errors
    /// [`Interrupted`] when the run is asked to stop.
    pub fn distances_nearby(
        &self,
        points: &[Vector<D>],
        time: f64,
        interrupt: &Interrupt,
    ) -> Result<Option<Vec<f64>>, Interrupted> {
        let Some(surface) = self.surface() else { return Ok(None) };
        let mut distances = vec![0.0; points.len()];
        points.par_chunks(PATHS).zip(distances.par_chunks_mut(PATHS)).for_each(|(points, distances)| {
            if interrupt.is_raised() {
                return;
            }
            let start = |points: &[Vector<D>]| {
                let mut starts = [Vector::<D>::zeros(); PATHS];
                starts[..points.len()].copy_from_slice(points);
                TUNING.nearby.advance_all(self.flow.as_ref(), &mut starts[..points.len()], time, -time);
                starts.map(|x| surface.signed_distance(&x))
            };
            let here = start(points);
            let mut gradients = [Vector::<D>::zeros(); PATHS];
            for d in 0..D {
                let mut aside = [Vector::<D>::zeros(); PATHS];
                for (aside, x) in aside.iter_mut().zip(points) {
                    *aside = *x;
                    aside[d] += TUNING.offset;
                }
                let there = start(&aside[..points.len()]);
                for (k, gradient) in gradients[..points.len()].iter_mut().enumerate() {
                    gradient[d] = (there[k] - here[k]) / TUNING.offset;
                }
            }
            for (k, distance) in distances.iter_mut().enumerate() {
                *distance = here[k] / gradients[k].norm();
            }
        });
        interrupt.check()?;
        Ok(Some(distances))
    }

    /// Moves points of the surface at the start to their approximate positions at a time.
    pub fn carry_about(&self, points: &mut [Vector<D>], time: f64, interrupt: &Interrupt) {
        points.par_chunks_mut(PATHS).for_each(|block| {
            if !interrupt.is_raised() {
                TUNING.rough.advance_all(self.flow.as_ref(), block, 0.0, time);
            }
        });
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
        let mut points = starts;
        points.par_chunks_mut(PATHS).for_each(|block| {
            if !interrupt.is_raised() {
                TUNING.tight.advance_all(self.flow.as_ref(), block, 0.0, time);
            }
        });
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

    /// Signed distances of points from the surface.
    ///
    /// # Errors
    /// [`Interrupted`] when the run is asked to stop.
    pub fn signed_distances(&self, points: &[Vector<D>], interrupt: &Interrupt) -> Result<Vec<f64>, Interrupted> {
        let mut distances = vec![0.0; points.len()];
        points.par_chunks(PATHS).zip(distances.par_chunks_mut(PATHS)).for_each(|(points, distances)| {
            if !interrupt.is_raised() {
                self.distances_of_block(points, distances);
            }
        });
        interrupt.check()?;
        Ok(distances)
    }

    /// Signed distances of up to [`PATHS`] points.
    fn distances_of_block(&self, points: &[Vector<D>], distances: &mut [f64]) {
        let flow = self.motion.flow.as_ref();
        let Some(front) = &self.advected else {
            // A rigid motion keeps distances; every other surface known by a formula is back at its start.
            for (distance, x) in distances.iter_mut().zip(points) {
                let start = flow.rigid_path(x, -self.time).unwrap_or(*x);
                *distance = self.surface.signed_distance(&start);
            }
            return;
        };
        let at_start = |integrator: PathIntegrator, points: &mut [Vector<D>], distances: &mut [f64]| {
            integrator.advance_all(flow, points, self.time, -self.time);
            for (distance, x) in distances.iter_mut().zip(points) {
                *distance = self.surface.signed_distance(x);
            }
        };
        // Only the side matters here; far from the surface a rough path tells it.
        let mut starts = [Vector::<D>::zeros(); PATHS];
        starts[..points.len()].copy_from_slice(points);
        at_start(TUNING.rough, &mut starts[..points.len()], distances);
        // A NaN is no side: the tight path tells it too.
        let is_near = |side: f64| side.is_nan() || side.abs() <= TUNING.rough_side;
        let near: Vec<usize> = (0..points.len()).filter(|k| is_near(distances[*k])).collect();
        let mut starts: Vec<Vector<D>> = near.iter().map(|k| points[*k]).collect();
        let mut sides = [0.0; PATHS];
        at_start(TUNING.tight, &mut starts, &mut sides);
        for (k, side) in near.into_iter().zip(sides) {
            distances[k] = side;
        }
        for (distance, x) in distances.iter_mut().zip(points) {
            *distance = front.distance(x).copysign(*distance);
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

    fn distance_of(front: &super::ExactFront<'_, 2>, x: Vector<2>) -> f64 {
        front.signed_distances(&[x], &Interrupt::default()).unwrap()[0]
    }

    #[test]
    fn a_returned_vortex_is_the_start() {
        let motion = ExactMotion::new(ball(), Arc::new(SingleVortex { period: Some(8.0) }));
        let front = motion.front(8.0, 1.0 / 64.0, &Interrupt::default()).unwrap().unwrap();
        assert!((distance_of(&front, Vector::<2>::new(0.5, 1.0)) - 0.1).abs() < 1e-15);
    }

    #[test]
    fn the_distance_nearby_agrees_with_the_advected_front() {
        let motion = ExactMotion::new(ball(), Arc::new(SingleVortex { period: Some(2.0) }));
        let front = motion.front(0.7, 1.0 / 64.0, &Interrupt::default()).unwrap().unwrap();
        for k in 0..8 {
            let angle = 0.8 * f64::from(k);
            let start = Vector::<2>::new(0.5 + 0.15 * angle.cos(), 0.75 + 0.15 * angle.sin());
            let mut near = [start];
            motion.carry_about(&mut near, 0.7, &Interrupt::default());
            let near = near[0] + Vector::<2>::new(3e-4, -2e-4);
            let distance = distance_of(&front, near);
            let nearby = motion.distances_nearby(&[near], 0.7, &Interrupt::default()).unwrap().unwrap()[0];
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
            assert!((distance_of(&front, x) - exact).abs() < 1e-7);
        }
    }

    #[test]
    fn rigid_motion_is_exact() {
        let rotation = Rotation { center: Vector::<2>::new(0.5, 0.5), angular_velocity: 1.0 };
        let motion = ExactMotion::new(ball(), Arc::new(rotation));
        let front = motion.front(std::f64::consts::FRAC_PI_2, 1.0 / 64.0, &Interrupt::default()).unwrap().unwrap();
        // A quarter turn takes the center to (0.25, 0.5).
        assert!((distance_of(&front, Vector::<2>::new(0.25, 0.8)) - 0.15).abs() < 1e-10);
    }
}
