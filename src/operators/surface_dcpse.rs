//! Surface DC-PSE in its intrinsic form (Surface DC-PSE paper, section 3, with the copies along normals eliminated).
//!
//! Extension along normals makes a field constant there, so that on the tangent plane at a point, with coordinates (X, Y)
//! of the projected neighbours, Δ_S f = f_XX + f_YY exactly: the plane touches the surface to second order, and the metric of the
//! projection is the identity up to it. One weighted fit of polynomials in (X, Y) a point gives the row.

use super::stencil_operator::StencilOperator;
use super::tangent_basis::TangentBasis;
use crate::geometry::{Domain, Vector};
use crate::linear_algebra::normal_equations::{LaneSystems, packed_row};
use crate::linear_algebra::number::{LANES, Lanes};
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{Interrupt, Interrupted};
use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};

/// Degree of the polynomials and the support of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Support {
    /// Total degree: 3, 5 or 7 for operators of order 2, 4 or 6.
    pub degree: usize,
    /// Radius of the support, r_c.
    pub radius: f64,
}

/// What a construction came to.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Soundness {
    /// Points whose support was enlarged, as often as it was.
    pub enlarged: u64,
    /// Points that no support of [`MOST_GROWTH`] r_c was enough for: their rows give no number.
    pub failed: u64,
    /// The least share of a pivot in its diagonal, of all points.
    pub least_pivot: f64,
}

/// Operators on the points of a surface with normals.
#[derive(Debug)]
pub struct SurfaceDcpse<'a> {
    /// Points.
    pub points: &'a [Vector<3>],
    /// Unit normals.
    pub normals: &'a [Vector<3>],
}

/// Neighbours for a function at least: fewer make the fit an interpolation of noise.
const NEIGHBORS_A_FUNCTION: f64 = 1.4;
/// How a support grows that is not enough, and how far.
const GROWTH: f64 = 1.2;
/// The largest support by r_c.
pub const MOST_GROWTH: f64 = 2.5;
/// Below this share of a pivot in its diagonal the moment conditions do not hold to the digits that are wanted.
const LEAST_PIVOT: f64 = 1e-9;
/// Cosine of normals beyond which a point belongs to another sheet.
const SAME_SHEET: f64 = 0.5;
/// Points of a parallel task; a multiple of the lanes.
const BLOCK: usize = 64;

/// Storage of a thread, and what it makes of a task.
#[derive(Default)]
struct Work {
    systems: LaneSystems,
    /// Neighbours of each lane, with X, Y and the window.
    near: [Vec<(u32, [f64; 3])>; LANES],
    /// Values of the functions, neighbour by neighbour.
    basis: Vec<Lanes>,
    /// Windows of the neighbours, weights after the solution.
    windows: Vec<Lanes>,
    solution: Vec<Lanes>,
    columns: Vec<u32>,
    weights: Vec<f64>,
    rows: StencilOperator,
    soundness: Soundness,
}

impl SurfaceDcpse<'_> {
    /// The Laplace–Beltrami operator.
    ///
    /// # Errors
    /// [`Interrupted`].
    pub fn laplace_beltrami(
        &self,
        support: Support,
        interrupt: &Interrupt,
    ) -> Result<(StencilOperator, Soundness), Interrupted> {
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(self.points.iter().copied(), support.radius);
        let basis = TangentBasis::new(support.degree);
        let functional = basis.laplacians();
        let blocks: Vec<(StencilOperator, Soundness)> = (0..self.points.len().div_ceil(BLOCK))
            .into_par_iter()
            .with_min_len(1)
            .map_init(Work::default, |work, block| {
                work.soundness = Soundness { least_pivot: 1.0, ..Soundness::default() };
                let end = ((block + 1) * BLOCK).min(self.points.len());
                for first in (block * BLOCK..end).step_by(LANES) {
                    if interrupt.is_raised() {
                        break;
                    }
                    self.rows_of(&cells, first..(first + LANES).min(end), &basis, support.radius, &functional, work);
                }
                (std::mem::take(&mut work.rows), work.soundness)
            })
            .collect();
        interrupt.check()?;
        let operator = StencilOperator::stacked(blocks.iter().map(|(rows, _)| rows));
        let mut soundness = Soundness { least_pivot: 1.0, ..Soundness::default() };
        for (_, found) in &blocks {
            soundness.enlarged += found.enlarged;
            soundness.failed += found.failed;
            soundness.least_pivot = soundness.least_pivot.min(found.least_pivot);
        }
        Ok((operator, soundness))
    }

    /// The rows of up to four points, one a lane; those whose support is not enough grow it together.
    fn rows_of(
        &self,
        cells: &CellList<3>,
        points: std::ops::Range<usize>,
        basis: &TangentBasis,
        radius: f64,
        functional: &[f64],
        work: &mut Work,
    ) {
        let number = basis.size();
        let wanted = (NEIGHBORS_A_FUNCTION * number as f64).ceil() as usize;
        let mut reach = [radius; LANES];
        for (lane, i) in points.clone().enumerate() {
            loop {
                self.gather(cells, i, reach[lane], &mut work.near[lane]);
                if work.near[lane].len() >= wanted || reach[lane] * GROWTH > MOST_GROWTH * radius {
                    break;
                }
                reach[lane] *= GROWTH;
                work.soundness.enlarged += 1;
            }
        }
        for lane in points.len()..LANES {
            // Spare lanes repeat the first.
            work.near[lane] = work.near[0].clone();
            reach[lane] = reach[0];
        }
        loop {
            let pivots = work.solve(basis, &reach, functional);
            let mut is_again = false;
            for (lane, i) in points.clone().enumerate() {
                let is_sound = pivots[lane] > LEAST_PIVOT && work.near[lane].len() >= number;
                if !is_sound && reach[lane] * GROWTH <= MOST_GROWTH * radius {
                    reach[lane] *= GROWTH;
                    work.soundness.enlarged += 1;
                    self.gather(cells, i, reach[lane], &mut work.near[lane]);
                    is_again = true;
                }
            }
            if !is_again {
                for (lane, i) in points.enumerate() {
                    let is_sound = pivots[lane] > LEAST_PIVOT && work.near[lane].len() >= number;
                    if is_sound {
                        work.soundness.least_pivot = work.soundness.least_pivot.min(pivots[lane]);
                        work.push_row(lane, i);
                    } else {
                        work.soundness.failed += 1;
                        // What is not known must not look like a number.
                        work.rows.push_row(&[i as u32], &[f64::NAN]);
                    }
                }
                return;
            }
        }
    }

    /// Neighbours of a point on its own sheet, with their tangential coordinates by `reach` and their windows.
    fn gather(&self, cells: &CellList<3>, i: usize, reach: f64, near: &mut Vec<(u32, [f64; 3])>) {
        near.clear();
        let (x, n) = (self.points[i], self.normals[i]);
        let [t1, t2] = tangents(&n);
        let inverse = 1.0 / reach;
        cells.for_each_within(&x, reach, |j, _, square| {
            if j != i && self.normals[j].dot(&n) > SAME_SHEET {
                let d = self.points[j] - x;
                let rest = (1.0 - square * inverse * inverse).max(0.0);
                let window = rest * rest;
                near.push((j as u32, [d.dot(&t1) * inverse, d.dot(&t2) * inverse, window * window]));
            }
        });
    }
}

/// Two unit vectors across a unit normal and each other.
fn tangents(n: &Vector<3>) -> [Vector<3>; 2] {
    // Of the axes the one that is farthest from the normal.
    let axis = n.iamin();
    let mut t1 = -n * n[axis];
    t1[axis] += 1.0;
    let t1 = t1.normalize();
    [t1, n.cross(&t1)]
}

impl Work {
    /// Moments and the solution for the functional in each lane. Returns the least share of a pivot in its diagonal.
    fn solve(&mut self, functions: &TangentBasis, reach: &[f64; LANES], functional: &[f64]) -> [f64; LANES] {
        let number = functions.size();
        let most = self.near.iter().map(Vec::len).max().unwrap_or(0);
        self.systems.reset(number);
        self.systems.matrix_mut().fill(Lanes::splat(0.0));
        self.basis.resize(most * number, Lanes::splat(0.0));
        self.windows.clear();
        for k in 0..most {
            let of =
                |part: usize| Lanes::new(std::array::from_fn(|lane| self.near[lane].get(k).map_or(0.0, |n| n.1[part])));
            let (x, y, window) = (of(0), of(1), of(2));
            let basis = &mut self.basis[k * number..(k + 1) * number];
            functions.values(x, y, basis);
            self.windows.push(window);
            let matrix = self.systems.matrix_mut();
            for (a, value) in basis.iter().enumerate() {
                let weighted = window * *value;
                let row = &mut matrix[packed_row(a)..=packed_row(a) + a];
                for (entry, other) in row.iter_mut().zip(&basis[..=a]) {
                    *entry = weighted.mul_add(*other, *entry);
                }
            }
        }
        let least = self.systems.factorise();
        // Functionals are of coordinates by the reach.
        let scale = Lanes::new(reach.map(|reach| 1.0 / (reach * reach)));
        self.solution.clear();
        self.solution.extend(functional.iter().map(|value| scale * Lanes::splat(*value)));
        self.systems.solve(&mut self.solution);
        // W_j z·p(x_j) for the neighbours of every lane.
        for (basis, window) in self.basis.chunks_exact(number).zip(&mut self.windows) {
            let products = basis.iter().zip(&self.solution);
            let value = products.fold(Lanes::splat(0.0), |sum, (p, z)| p.mul_add(*z, sum));
            *window *= value;
        }
        least.to_array()
    }

    /// The row of a lane: its neighbours, and for the point itself what makes the sum zero.
    fn push_row(&mut self, lane: usize, i: usize) {
        self.columns.clear();
        self.weights.clear();
        let mut sum = 0.0;
        for ((j, _), weights) in self.near[lane].iter().zip(&self.windows) {
            let weight = weights.as_array()[lane];
            sum += weight;
            self.columns.push(*j);
            self.weights.push(weight);
        }
        self.columns.push(i as u32);
        self.weights.push(-sum);
        self.rows.push_row(&self.columns, &self.weights);
    }
}

#[cfg(test)]
mod tests {
    use super::{Support, SurfaceDcpse, Vector};
    use crate::geometry::fibonacci;
    use crate::parallel::Interrupt;

    /// Relative L2 error of Δ_S of the plane wave sin(k·x) on the unit sphere.
    fn error(count: usize, degree: usize, radius: f64) -> f64 {
        let points = fibonacci::sphere(count);
        let spacing = (4.0 * std::f64::consts::PI / count as f64).sqrt();
        let surface = SurfaceDcpse { points: &points, normals: &points };
        let support = Support { degree, radius: radius * spacing };
        let (operator, soundness) = surface.laplace_beltrami(support, &Interrupt::default()).unwrap();
        assert_eq!((operator.rows(), soundness.failed), (count, 0));
        let wave = Vector::<3>::new(2.0, -1.0, 3.0);
        let field: Vec<f64> = points.iter().map(|x| wave.dot(x).sin()).collect();
        let mut found = vec![0.0; count];
        operator.apply(&field, &mut found);
        let (mut top, mut bottom) = (0.0, 0.0);
        for (x, found) in points.iter().zip(found) {
            let (phase, along) = (wave.dot(x), wave.dot(x));
            let exact = -(wave.norm_squared() - along * along) * phase.sin() - 2.0 * along * phase.cos();
            top += (found - exact).powi(2);
            bottom += exact * exact;
        }
        (top / bottom).sqrt()
    }

    #[test]
    fn orders_are_one_below_the_degree() {
        for (degree, radius, order) in [(3, 2.4, 1.95), (5, 3.3, 3.9), (7, 4.2, 5.8)] {
            let errors = [1000, 2000, 4000, 8000].map(|count| error(count, degree, radius));
            let slope = 2.0 * (errors[0] / errors[3]).ln() / 8.0_f64.ln();
            assert!(slope > order, "degree {degree}: {errors:?}, order {slope}");
        }
    }

    #[test]
    fn starved_supports_grow() {
        assert!(error(2000, 3, 1.2) < 2e-2);
    }
}
