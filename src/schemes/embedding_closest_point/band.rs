//! Grid nodes about a surface, their closest points, and interpolation of nodal values.

use crate::geometry::{Surface, Vector};
use crate::parallel::{Interrupt, Interrupted};
use rayon::prelude::{IndexedParallelIterator, IntoParallelRefIterator, IntoParallelRefMutIterator, ParallelIterator};

/// Most nodes of an interpolation along an axis.
const MOST: usize = 6;
/// Nodes that a task works on at least.
const NODES: usize = 256;

/// Where a point lies in the grid: the first node of its cube, and weights along the axes.
#[derive(Debug, Clone, Copy, Default)]
struct Place {
    first: [i32; 3],
    weights: [[f64; MOST]; 3],
}

/// Nodes within reach of a surface. The first [`Band::inner`] are those that interpolation needs; those behind
/// complete the differences of the inner ones.
#[derive(Debug)]
pub struct Band {
    spacing: f64,
    order: usize,
    low: [i32; 3],
    size: [usize; 3],
    /// Node by cell of the box; none is [`u32::MAX`].
    index: Vec<u32>,
    /// Closest points of all nodes.
    pub closest: Vec<Vector<3>>,
    inner: usize,
    places: Vec<Place>,
    /// Nodes along the axes of the inner ones: for each the lower and the upper, nearest first.
    around: Vec<[u32; 12]>,
}

/// Half width of the inner band in spacings: a cube of order + 2 nodes a side about any point of the surface.
pub fn inner_half_width(order: usize) -> f64 {
    3.0_f64.sqrt() * (order as f64 + 2.0) / 2.0
}

impl Band {
    /// Nodes about a surface; `order` 2 or 4.
    ///
    /// # Errors
    /// [`Interrupted`].
    pub fn about(
        surface: &dyn Surface<3>,
        spacing: f64,
        order: usize,
        interrupt: &Interrupt,
    ) -> Result<Self, Interrupted> {
        let inner_reach = inner_half_width(order) * spacing;
        let reach = inner_reach + (order / 2) as f64 * spacing;
        let (from, to) = surface.bounding_box();
        let low: [i32; 3] = std::array::from_fn(|d| ((from[d] - reach) / spacing).floor() as i32 - 1);
        let size: [usize; 3] =
            std::array::from_fn(|d| (((to[d] + reach) / spacing).ceil() as i32 + 2 - low[d]) as usize);
        let cells = size[0] * size[1] * size[2];
        let at = |cell: usize| {
            let place = [cell % size[0], cell / size[0] % size[1], cell / (size[0] * size[1])];
            Vector::<3>::from_fn(|d, _| f64::from(low[d] + place[d] as i32) * spacing)
        };
        let mut index = vec![u32::MAX; cells];
        let (mut inner, mut outer) = (Vec::new(), Vec::new());
        let planes: Vec<usize> = (0..size[2]).collect();
        let plane = size[0] * size[1];
        let found: Vec<Vec<(usize, f64, Vector<3>)>> = planes
            .par_iter()
            .map(|z| {
                let mut found = Vec::new();
                let mut cell = z * plane;
                while cell < (z + 1) * plane && !interrupt.is_raised() {
                    let nearest = surface.nearest(&at(cell));
                    if nearest.distance.abs() <= reach {
                        found.push((cell, nearest.distance, nearest.point));
                    }
                    // Along a row nothing lies within reach for as far as the surface is away.
                    let free = ((nearest.distance.abs() - reach) / spacing).floor();
                    let rest = size[0] - cell % size[0];
                    cell += (free.max(0.0) as usize + 1).min(rest.max(1));
                }
                found
            })
            .collect();
        interrupt.check()?;
        for (cell, distance, point) in found.into_iter().flatten() {
            if distance.abs() <= inner_reach { inner.push((cell, point)) } else { outer.push((cell, point)) }
        }
        let count = inner.len();
        inner.append(&mut outer);
        for (k, (cell, _)) in inner.iter().enumerate() {
            index[*cell] = k as u32;
        }
        let closest: Vec<_> = inner.iter().map(|(_, point)| *point).collect();
        let mut band =
            Self { spacing, order, low, size, index, closest, inner: count, places: Vec::new(), around: Vec::new() };
        band.places = band.closest.par_iter().with_min_len(NODES).map(|x| band.place(x)).collect();
        let strides = [1, size[0] as isize, plane as isize];
        band.around = inner[..count]
            .par_iter()
            .with_min_len(NODES)
            .map(|(cell, _)| {
                let neighbor = |by: isize| band.index[cell.wrapping_add_signed(by)];
                let mut around = [u32::MAX; 12];
                for (d, stride) in strides.iter().enumerate() {
                    for far in 0..order / 2 {
                        let by = stride * (far as isize + 1);
                        around[4 * d + 2 * far] = neighbor(-by);
                        around[4 * d + 2 * far + 1] = neighbor(by);
                    }
                }
                around
            })
            .collect();
        Ok(band)
    }

    /// Nodes of an interpolation along an axis: a polynomial of degree order + 1.
    fn nodes(&self) -> usize {
        self.order + 2
    }

    fn place(&self, x: &Vector<3>) -> Place {
        let nodes = self.nodes();
        let mut place = Place::default();
        for d in 0..3 {
            let scaled = x[d] / self.spacing;
            place.first[d] = scaled.floor() as i32 - (nodes as i32 / 2 - 1);
            let t = scaled - f64::from(place.first[d]);
            for k in 0..nodes {
                let others = (0..nodes).filter(|j| *j != k);
                place.weights[d][k] = others.map(|j| (t - j as f64) / (k as f64 - j as f64)).product();
            }
        }
        place
    }

    /// Σ w u over the cube of a place.
    fn interpolated(&self, place: &Place, u: &[f64]) -> f64 {
        let nodes = self.nodes();
        let start: [usize; 3] = std::array::from_fn(|d| (place.first[d] - self.low[d]) as usize);
        let mut sum = 0.0;
        for c in 0..nodes {
            let mut plane = 0.0;
            for b in 0..nodes {
                let from = start[0] + self.size[0] * (start[1] + b + self.size[1] * (start[2] + c));
                let row = &self.index[from..from + nodes];
                let values = row.iter().zip(&place.weights[0]).map(|(node, w)| w * u[*node as usize]);
                plane += place.weights[1][b] * values.sum::<f64>();
            }
            sum += place.weights[2][c] * plane;
        }
        sum
    }

    /// Nodes of the interpolation.
    pub fn len(&self) -> usize {
        self.closest.len()
    }

    /// The values of inner nodes extended constantly along normals: out_g = u(cp(x_g)).
    pub fn extend(&self, u: &[f64], out: &mut [f64]) {
        out.par_iter_mut()
            .with_min_len(NODES)
            .zip(&self.places)
            .for_each(|(out, place)| *out = self.interpolated(place, u));
    }

    /// Δ by central differences at the inner nodes.
    pub fn laplacian(&self, u: &[f64], out: &mut [f64]) {
        let scale = 1.0 / (self.spacing * self.spacing);
        let weights: &[f64] = if self.order == 2 { &[1.0] } else { &[4.0 / 3.0, -1.0 / 12.0] };
        let middle = if self.order == 2 { -2.0 } else { -2.5 };
        out[..self.inner].par_iter_mut().with_min_len(NODES).zip(&self.around).enumerate().for_each(
            |(i, (out, around))| {
                let mut sum = 3.0 * middle * u[i];
                for d in 0..3 {
                    for (far, weight) in weights.iter().enumerate() {
                        let [lower, upper] = [around[4 * d + 2 * far], around[4 * d + 2 * far + 1]];
                        sum += weight * (u[lower as usize] + u[upper as usize]);
                    }
                }
                *out = sum * scale;
            },
        );
    }

    /// Values at points of the surface from those of inner nodes.
    pub fn evaluate(&self, places: &Places, u: &[f64], out: &mut [f64]) {
        out.par_iter_mut()
            .with_min_len(NODES)
            .zip(&places.0)
            .for_each(|(out, place)| *out = self.interpolated(place, u));
    }

    /// Places of points of the surface, for [`Band::evaluate`].
    pub fn places(&self, points: &[Vector<3>]) -> Places {
        Places(points.par_iter().with_min_len(NODES).map(|x| self.place(x)).collect())
    }
}

/// Where points of the surface lie in the grid.
#[derive(Debug)]
pub struct Places(Vec<Place>);
