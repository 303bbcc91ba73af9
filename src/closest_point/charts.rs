//! Closest points on fits whose coordinates are not those of space.
//!
//! Each fit gives the level set as a function of its own coordinates X, with a map x(X) into space: initial positions of
//! particles that a flow carries, or coordinates in which a stretched cloud is even. Closest points are found by the
//! same Newton steps as in space, where a step s changes X by J⁻¹ s with J = ∂x/∂X.

use super::method::PcpMethod;
use super::newton::{ACCEPTED, LONGEST_STEP, Progress, is_last_step, newton_step};
use super::projection::{Projected, project};
use super::queries::{ClosestPoints, QUERIES};
use super::redistancing::{ClosestPoint, QueryCounts};
use super::rescue::RescueCounts;
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{Interrupt, Interrupted};
use crate::polynomials::{Fit, Jet};
use nalgebra::SMatrix;
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSlice, ParallelSliceMut};

/// Results of a fit at a point X of its coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot<const D: usize> {
    /// Position x(X) in space.
    pub point: Vector<D>,
    /// Value, gradient and Hessian of the level set in space.
    pub jet: Jet<f64, D>,
    /// Gradient of the level in the coordinates of the fit.
    pub own_gradient: Vector<D>,
    /// The inverse J⁻¹ of the Jacobian J = ∂x/∂X.
    pub inverse: SMatrix<f64, D, D>,
}

/// A point of the surface with the fit by which it was found.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seed<const D: usize> {
    /// Index of the fit.
    pub patch: usize,
    /// The point in the coordinates X of the fit.
    pub own: Vector<D>,
    /// Results of the fit at the point.
    pub spot: Spot<D>,
}

/// Points of the surface with a search for the nearest one.
#[derive(Debug)]
pub(super) struct Seeds<const D: usize> {
    pub list: Vec<Seed<D>>,
    pub cells: CellList<D>,
}

impl<const D: usize> Seeds<D> {
    /// No seeds.
    pub fn new() -> Self {
        Self { list: Vec::new(), cells: CellList::new(Domain::unbounded()) }
    }

    /// Sorts the seeds into cells with edges of at least `edge`.
    pub fn sort(&mut self, edge: f64) {
        self.cells.rebuild(self.list.iter().map(|seed| seed.spot.point), edge);
    }
}

/// Fits with coordinates of their own.
pub(super) trait Chart<const D: usize>: Sync {
    /// Parameters of the iterations.
    fn method(&self) -> &PcpMethod;

    /// Geometry of a fit; None where there is none.
    fn fit(&self, patch: usize) -> Option<&Fit<D>>;

    /// Results of a fit at a point of its coordinates; None where the Jacobian is singular.
    fn spot(&self, patch: usize, fit: &Fit<D>, own: &Vector<D>) -> Option<Spot<D>>;

    /// Projects a point onto the zero of a fit along the gradient in the coordinates of the fit.
    ///
    /// This is the shortest way there. The gradient in space may lead far along the surface.
    fn project(&self, patch: usize, fit: &Fit<D>, start: &Vector<D>) -> Option<Seed<D>> {
        let Projected { x, step, .. } = project(self.method(), fit, start, |x| {
            let spot = self.spot(patch, fit, x)?;
            Some((spot.jet.value, spot.own_gradient, ()))
        })?;
        let own = x + step;
        self.spot(patch, fit, &own).map(|spot| Seed { patch, own, spot })
    }

    /// The seed by which an iteration goes on that left its fit at `place`: the nearest one.
    fn seed_near(&self, seeds: &Seeds<D>, place: &Vector<D>) -> Option<usize> {
        seeds.cells.nearest(place, f64::INFINITY).map(|(seed, _)| seed)
    }

    /// The closest point of the surface to `x`; None without a seed within `cutoff`.
    fn query_from(&self, seeds: &Seeds<D>, x: &Vector<D>, cutoff: f64) -> Option<ClosestPoint<D>> {
        let (nearest, distance) = seeds.cells.nearest(x, cutoff)?;
        Some(self.solve(seeds, nearest, distance, x, &mut QueryCounts::default()))
    }

    /// The closest point for a query whose nearest seed lies at the given distance.
    ///
    /// Newton's method starts from the nearest seed. If it leaves the fit, it continues from the seed nearest to the
    /// iterate. If the foot point is farther away than the nearest seed, or if there is none, the result is the seed
    /// itself.
    fn solve(
        &self,
        seeds: &Seeds<D>,
        nearest: usize,
        distance: f64,
        x: &Vector<D>,
        query_counts: &mut QueryCounts,
    ) -> ClosestPoint<D> {
        query_counts.queries += 1;
        let mut current = nearest;
        for changes in 0..=MAX_SAMPLE_CHANGES {
            match self.newton(&seeds.list[current], x, query_counts) {
                Ok(closest) => {
                    let slack = self.method().slack(x);
                    if closest.distance <= distance * (1.0 + 1e-9) + slack {
                        query_counts.other_sample += u64::from(changes > 0);
                        return closest;
                    }
                    break;
                }
                Err(Some(left)) => match self.seed_near(seeds, &left) {
                    Some(next) if next != current => current = next,
                    _ => break,
                },
                Err(None) => break,
            }
        }
        query_counts.sample_distance += 1;
        let Spot { point, jet, .. } = &seeds.list[nearest].spot;
        closest_point(x, point, jet, true)
    }

    /// The closest point on the fit of a seed. The error is the position where the iteration left the fit, or None
    /// where it did not converge.
    fn newton(
        &self,
        seed: &Seed<D>,
        x: &Vector<D>,
        query_counts: &mut QueryCounts,
    ) -> Result<ClosestPoint<D>, Option<Vector<D>>> {
        let method = self.method();
        let fit = self.fit(seed.patch).ok_or(None)?;
        let mut own = seed.own;
        let mut spot = seed.spot;
        let mut last = f64::INFINITY;
        let mut left = false;
        let mut progress = Progress::default();
        for _ in 0..method.max_iterations {
            query_counts.iterations += 1;
            let offset: [f64; D] = (x - spot.point).into();
            let step = newton_step(&spot.jet, &offset);
            let mut shift = spot.inverse * Vector::<D>::from(step);
            let length = shift.norm();
            if !length.is_finite() {
                return Err(None);
            }
            if is_last_step(method, length, last, fit.radius, own.amax()) {
                let foot = spot.point + Vector::<D>::from(step);
                return Ok(closest_point(x, &foot, &spot.jet.translated(&step), false));
            }
            if progress.is_stuck(length) {
                return Err(None);
            }
            let longest = LONGEST_STEP * fit.radius;
            if length > longest {
                shift *= longest / length;
            }
            own += shift;
            // An iteration may leave the support once and come back. It ends when it stays outside.
            let outside = (own - fit.middle).norm_squared() > fit.radius * fit.radius;
            spot = self.spot(seed.patch, fit, &own).ok_or(None)?;
            if outside && (left || length <= ACCEPTED * fit.radius) {
                return Err(Some(spot.point));
            }
            left = outside;
            last = length;
        }
        Err(None)
    }

    /// [`Self::query_from`] for many points at once.
    ///
    /// # Errors
    /// [`Interrupted`] when the interrupt is raised.
    fn closest_points_from(
        &self,
        seeds: &Seeds<D>,
        (points, cutoff): (&[Vector<D>], f64),
        results: &mut ClosestPoints<D>,
        counts: &RescueCounts,
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        let feet = results.resize_to_queries(points.len());
        feet.par_chunks_mut(QUERIES).zip(points.par_chunks(QUERIES)).for_each(|(feet, points)| {
            if interrupt.is_raised() {
                return;
            }
            let mut query_counts = QueryCounts::default();
            let mut last = None;
            for (foot, x) in feet.iter_mut().zip(points) {
                let nearest = seeds.cells.nearest_next(x, cutoff, &mut last, |seed| seeds.list[seed].spot.point);
                *foot = nearest.map(|(seed, r2)| self.solve(seeds, seed, r2.sqrt(), x, &mut query_counts));
            }
            query_counts.add_to(counts);
        });
        interrupt.check()
    }
}

/// Largest number of changes to another seed's fit before the nearest seed itself is the result.
const MAX_SAMPLE_CHANGES: usize = 4;

/// The closest point `foot` to `x` with the geometry of the level set there.
fn closest_point<const D: usize>(
    x: &Vector<D>,
    foot: &Vector<D>,
    jet: &Jet<f64, D>,
    is_sample: bool,
) -> ClosestPoint<D> {
    let offset = x - foot;
    let normal = Vector::<D>::from(jet.normal());
    ClosestPoint {
        point: *foot,
        distance: offset.norm(),
        normal,
        curvature: jet.curvature(),
        is_outside: offset.dot(&normal) >= 0.0,
        is_sample,
    }
}
