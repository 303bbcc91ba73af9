//! Stars: the Voronoi cell of a point among its neighbors in the tangent plane, its facets and its triangles.
//!
//! The cell of a point is cut out of an octagon about it by the bisectors to its neighbors. Distances to the neighbors are
//! kept: a neighbor is projected along the normal and moved back to its distance. On a curve the cell is the part of the
//! tangent up to the middle of the way to the next point on either side.

use super::local_spacing::Nearest;
use crate::geometry::Vector;
use crate::geometry::frame::tangents;
use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};

/// Neighbors that are looked at for a cell of a surface, and of a curve.
pub const CANDIDATES: [usize; 2] = [10, 30];
/// Sine of the elevation above the tangent plane up to which a neighbor takes part.
const STEEP: f64 = 0.9;
/// Radius of the octagon in local spacings. Of 1.5, 2, 2.5 and 3 the third leaves one of 4,000 independent random points open.
const REACH: f64 = 2.5;
/// Least area of a cell by that of a square of the local spacing.
const LEAST_AREA: f64 = 0.05;
/// Sides of the octagon.
const SIDES: usize = 8;
/// Tag of an edge of the octagon.
const OUTER: u32 = u32::MAX;

/// A facet of a cell, between the point and a neighbor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Facet {
    /// Index of the neighbor.
    pub neighbor: u32,
    /// Length of the facet by the distance of the neighbor; on a curve, one by the distance.
    pub conductance: f64,
    /// Distance of the middle of the facet from the middle of the way to the neighbor, counter-clockwise; 0 on a curve.
    pub offset: f64,
    /// Whether the facet that follows counter-clockwise is one of a neighbor, too: the point and both are a triangle.
    pub is_joined: bool,
}

/// The cell of a point.
#[derive(Debug, Clone, Default)]
pub struct Cell {
    /// Its facets, counter-clockwise about the normal.
    pub facets: Vec<Facet>,
    /// Area of the cell, or length on a curve.
    pub area: f64,
    /// Whether the cell reaches its outer bound, as at an edge of the surface.
    pub is_open: bool,
    polygon: Polygon,
    spare: Polygon,
    /// Tangent coordinates of the neighbors that cut the cell.
    seen: Vec<([f64; 2], u32)>,
}

/// Vertices of a convex polygon, each with the tag of the edge that follows it.
type Polygon = Vec<([f64; 2], u32)>;

impl Cell {
    /// Computes the cell of point i from its nearest neighbors, for a unit normal and a local spacing.
    pub fn compute<const D: usize>(
        &mut self,
        points: &[Vector<D>],
        i: usize,
        near: &[u32],
        normal: &Vector<D>,
        spacing: f64,
    ) {
        self.facets.clear();
        if D == 2 {
            self.on_curve(points, i, near, normal, spacing);
        } else {
            self.on_surface(points, i, near, normal, spacing);
        }
    }

    fn on_curve<const D: usize>(
        &mut self,
        points: &[Vector<D>],
        i: usize,
        near: &[u32],
        normal: &Vector<D>,
        spacing: f64,
    ) {
        let [tangent] = tangents::<D, 1>(normal);
        let mut sides = [None, None];
        for j in near {
            let d = points[*j as usize] - points[i];
            let distance = d.norm();
            let side = &mut sides[usize::from(d.dot(&tangent) < 0.0)];
            let is_in_reach = distance > 0.0 && distance <= 2.0 * REACH * spacing;
            if side.is_none() && is_in_reach && d.dot(normal).abs() <= STEEP * distance {
                *side = Some((*j, distance));
            }
        }
        self.is_open = sides.contains(&None);
        self.area = sides.iter().flatten().map(|(_, distance)| 0.5 * distance).sum::<f64>().max(LEAST_AREA * spacing);
        let facet = |(neighbor, distance): &(u32, f64)| Facet {
            neighbor: *neighbor,
            conductance: 1.0 / distance,
            offset: 0.0,
            is_joined: false,
        };
        self.facets.extend(sides.iter().flatten().map(facet));
    }

    fn on_surface<const D: usize>(
        &mut self,
        points: &[Vector<D>],
        i: usize,
        near: &[u32],
        normal: &Vector<D>,
        spacing: f64,
    ) {
        let [first, second] = tangents::<D, 2>(normal);
        // Counter-clockwise about the normal, whatever the order of the tangents.
        let turn = if D == 3 { triple(&first, &second, normal).signum() } else { 1.0 };
        let reach = REACH * spacing;
        self.polygon.clear();
        self.polygon.extend((0..SIDES).map(|k| {
            let angle = std::f64::consts::TAU * k as f64 / SIDES as f64;
            let radius = reach / (std::f64::consts::PI / SIDES as f64).cos();
            ([radius * angle.cos(), radius * angle.sin()], OUTER)
        }));
        self.seen.clear();
        let mut farthest = square(self.polygon[0].0);
        for j in near {
            let d = points[*j as usize] - points[i];
            let distance = d.norm();
            if distance * distance > 4.0 * farthest {
                break;
            }
            if distance <= 0.0 || d.dot(normal).abs() > STEEP * distance {
                continue;
            }
            let flat = [d.dot(&first), turn * d.dot(&second)];
            let scale = distance / square(flat).sqrt();
            let y = flat.map(|c| c * scale);
            if self.cut(y) {
                self.seen.push((y, *j));
                farthest = self.polygon.iter().map(|(v, _)| square(*v)).fold(0.0, f64::max);
            }
        }
        self.measure(spacing);
    }

    /// Cuts the polygon by the bisector to a neighbor at `y`; false where it does not reach the polygon.
    fn cut(&mut self, y: [f64; 2]) -> bool {
        let half = 0.5 * square(y);
        let beyond = |v: [f64; 2]| v[0] * y[0] + v[1] * y[1] - half;
        if self.polygon.iter().all(|(v, _)| beyond(*v) <= 0.0) {
            return false;
        }
        self.spare.clear();
        let count = self.polygon.len();
        for k in 0..count {
            let ((v, tag), (w, _)) = (self.polygon[k], self.polygon[(k + 1) % count]);
            let (from, to) = (beyond(v), beyond(w));
            let crossing = || {
                let share = from / (from - to);
                [v[0] + share * (w[0] - v[0]), v[1] + share * (w[1] - v[1])]
            };
            if from <= 0.0 {
                self.spare.push((v, tag));
                if to > 0.0 {
                    self.spare.push((crossing(), self.seen.len() as u32));
                }
            } else if to <= 0.0 {
                self.spare.push((crossing(), tag));
            }
        }
        std::mem::swap(&mut self.polygon, &mut self.spare);
        true
    }

    /// Facets and area of the polygon.
    fn measure(&mut self, spacing: f64) {
        let count = self.polygon.len();
        self.is_open = self.polygon.iter().any(|(_, tag)| *tag == OUTER);
        self.area = 0.0;
        for k in 0..count {
            let ((p, tag), (q, next)) = (self.polygon[k], self.polygon[(k + 1) % count]);
            let Some((y, neighbor)) = self.seen.get(tag as usize) else { continue };
            let before = self.polygon[(k + count - 1) % count].1;
            let distance = square(*y).sqrt();
            let along = [-y[1] / distance, y[0] / distance];
            // At the outer bound a facet ends where it crosses the way to the neighbor: nothing flows through an edge.
            let from = if before == OUTER { 0.0 } else { -(p[0] * along[0] + p[1] * along[1]) };
            let to = if next == OUTER { 0.0 } else { q[0] * along[0] + q[1] * along[1] };
            self.area += 0.25 * distance * (from + to);
            let conductance = (from + to).max(0.0) / distance;
            let offset = 0.5 * (to - from);
            self.facets.push(Facet { neighbor: *neighbor, conductance, offset, is_joined: next != OUTER });
        }
        self.area = self.area.max(LEAST_AREA * spacing * spacing);
    }

    /// The unit normal of the star: Σ (x_j − x_i) × (x_k − x_i) over its triangles, and on a curve the normal of the circle
    /// through both neighbors. It has the side of the normal that the cell was computed with; None without triangles.
    #[must_use]
    pub fn normal<const D: usize>(&self, points: &[Vector<D>], i: usize, before: &Vector<D>) -> Option<Vector<D>> {
        let d = |facet: &Facet| points[facet.neighbor as usize] - points[i];
        let mut sum = Vector::<D>::zeros();
        if D == 2 {
            let [first, second] = self.facets.as_slice() else { return None };
            let (a, b) = (d(first), d(second));
            let along = a / a.norm_squared() - b / b.norm_squared();
            (sum[0], sum[1]) = (-along[1], along[0]);
        } else {
            for (k, facet) in self.facets.iter().enumerate().filter(|(_, facet)| facet.is_joined) {
                sum += cross(&d(facet), &d(&self.facets[(k + 1) % self.facets.len()]));
            }
        }
        let length = sum.norm();
        let sign = if sum.dot(before) < 0.0 { -1.0 } else { 1.0 };
        (length > 0.0).then(|| sum * (sign / length))
    }
}

fn square([x, y]: [f64; 2]) -> f64 {
    x * x + y * y
}

fn cross<const D: usize>(a: &Vector<D>, b: &Vector<D>) -> Vector<D> {
    Vector::<D>::from_fn(|d, _| a[(d + 1) % D] * b[(d + 2) % D] - a[(d + 2) % D] * b[(d + 1) % D])
}

fn triple<const D: usize>(a: &Vector<D>, b: &Vector<D>, c: &Vector<D>) -> f64 {
    cross(a, b).dot(c)
}

/// The cells of all points.
#[derive(Debug, Clone, Default)]
pub struct Stars {
    /// First facet of each point, and their number at the end.
    starts: Vec<usize>,
    facets: Vec<Facet>,
    /// Area of each cell.
    pub areas: Vec<f64>,
    /// Whether each cell is open.
    pub is_open: Vec<bool>,
}

/// Points of a parallel task.
const BLOCK: usize = 256;

impl Stars {
    /// The cells of points with unit normals and local spacings.
    #[must_use]
    pub fn new<const D: usize>(
        points: &[Vector<D>],
        nearest: &Nearest,
        normals: &[Vector<D>],
        spacing: &[f64],
    ) -> Self {
        let count = points.len();
        let block = |cell: &mut Cell, block: usize| {
            let mut part = Self::default();
            for i in block * BLOCK..((block + 1) * BLOCK).min(count) {
                cell.compute(points, i, nearest.of(i), &normals[i], spacing[i]);
                part.facets.extend_from_slice(&cell.facets);
                part.starts.push(part.facets.len());
                part.areas.push(cell.area);
                part.is_open.push(cell.is_open);
            }
            part
        };
        let blocks: Vec<Self> =
            (0..count.div_ceil(BLOCK)).into_par_iter().with_min_len(1).map_init(Cell::default, block).collect();
        let mut whole = Self { starts: vec![0], ..Self::default() };
        for part in blocks {
            let before = whole.facets.len();
            whole.facets.extend_from_slice(&part.facets);
            whole.starts.extend(part.starts.iter().map(|end| before + end));
            whole.areas.extend_from_slice(&part.areas);
            whole.is_open.extend_from_slice(&part.is_open);
        }
        whole
    }

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.areas.len()
    }

    /// Whether there are no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.areas.is_empty()
    }

    /// Facets of point i, counter-clockwise.
    #[must_use]
    pub fn facets(&self, i: usize) -> &[Facet] {
        &self.facets[self.starts[i]..self.starts[i + 1]]
    }

    /// Whether the star of point i is closed: triangles all around on a surface, neighbors on both sides on a curve.
    #[must_use]
    pub fn is_closed(&self, i: usize) -> bool {
        !self.is_open[i] && self.facets(i).len() > 1
    }
}

/// Unit normals of the stars, computed with given normals and then again with those of the stars, `rounds` times in all.
///
/// A normal keeps its side. Where a star has no triangle, the normal stays as it was.
#[must_use]
pub fn refined_normals<const D: usize>(
    points: &[Vector<D>],
    nearest: &Nearest,
    mut normals: Vec<Vector<D>>,
    spacing: &[f64],
    rounds: usize,
) -> Vec<Vector<D>> {
    for _ in 0..rounds {
        let refined = |cell: &mut Cell, i: usize| {
            cell.compute(points, i, nearest.of(i), &normals[i], spacing[i]);
            cell.normal(points, i, &normals[i]).unwrap_or(normals[i])
        };
        normals =
            (0..points.len()).into_par_iter().with_min_len(BLOCK).map_init(Cell::default, refined).collect::<Vec<_>>();
    }
    normals
}

#[cfg(test)]
mod tests {
    use super::{CANDIDATES, Stars, Vector, refined_normals};
    use crate::geometry::fibonacci;
    use crate::point_clouds::local_spacing::{Nearest, at_each_point, smoothed};
    use std::f64::consts::{PI, TAU};

    fn stars<const D: usize>(points: &[Vector<D>], normals: &[Vector<D>]) -> Stars {
        let nearest = Nearest::new(points, CANDIDATES[D - 2]);
        let spacing = smoothed::<D>(&at_each_point(points, &nearest), &nearest);
        Stars::new(points, &nearest, normals, &spacing)
    }

    #[test]
    fn cells_tile_a_sphere() {
        for (count, bound) in [(1000, 6e-4), (4000, 1.5e-4)] {
            let points = fibonacci::sphere(count);
            let stars = stars(&points, &points);
            let area: f64 = stars.areas.iter().sum();
            assert!((area / (4.0 * PI) - 1.0).abs() < bound, "{count}: {area}");
            assert!((0..count).all(|i| stars.is_closed(i) && stars.facets(i).len() >= 4));
        }
    }

    /// The facets of a square lattice have the length of its side; at its edge cells are open.
    #[test]
    fn cells_of_a_lattice_are_its_squares() {
        let points: Vec<_> = (0..100).map(|k| Vector::<3>::new(f64::from(k % 10), f64::from(k / 10), 0.0)).collect();
        let stars = stars(&points, &vec![Vector::<3>::z(); 100]);
        let inner = stars.facets(55);
        assert!((stars.areas[55] - 1.0).abs() < 1e-12 && !stars.is_open[55]);
        let sum: f64 = inner.iter().map(|facet| facet.conductance).sum();
        assert!((sum - 4.0).abs() < 1e-12, "{inner:?}");
        // Half a square at an edge, a quarter in a corner.
        assert!(stars.is_open[5] && (stars.areas[5] - 0.5).abs() < 1e-12, "{}", stars.areas[5]);
        assert!(stars.is_open[0] && (stars.areas[0] - 0.25).abs() < 1e-12, "{}", stars.areas[0]);
    }

    #[test]
    fn cells_of_a_curve_are_its_arcs() {
        let at = |i: i32| TAU * (f64::from(i) + 3.0 * (TAU * f64::from(i) / 100.0).sin()) / 100.0;
        let points: Vec<_> = (0..100).map(|i| Vector::<2>::new(at(i).cos(), at(i).sin())).collect();
        let stars = stars(&points, &points);
        let length: f64 = stars.areas.iter().sum();
        assert!((length / TAU - 1.0).abs() < 1e-3, "{length}");
        assert!((0..100).all(|i| stars.is_closed(i)));
    }

    #[test]
    fn stars_correct_normals() {
        let points = fibonacci::sphere(2000);
        let nearest = Nearest::new(&points, 30);
        let spacing = smoothed::<3>(&at_each_point(&points, &nearest), &nearest);
        let off = |k: f64| Vector::<3>::new((7.0 * k).sin(), (11.0 * k).cos(), (5.0 * k).sin()) * 0.15;
        let turned = points.iter().enumerate().map(|(i, n)| (n + off(i as f64)).normalize()).collect();
        let found = refined_normals(&points, &nearest, turned, &spacing, 2);
        assert!(points.iter().zip(&found).all(|(n, found)| n.dot(found) > 0.999));
    }
}
