//! Sums over pairs, gathered particle by particle in the order of pencils, several pairs side by side.

use crate::linear_algebra::number::{LANES, Lanes, Number};
use crate::neighbors::pencils::Near;
use std::array::from_fn;

/// `V` vector columns and `S` scalar columns in the order of places.
#[derive(Debug, Clone, Copy)]
pub(super) struct Columns<'a, const D: usize, const V: usize, const S: usize> {
    /// Vectors by component; the first are positions in units of ε.
    pub vectors: [[&'a [f64]; D]; V],
    /// Numbers.
    pub scalars: [&'a [f64]; S],
}

/// The values of one place, in every lane; or those of several places, one a lane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Side<const D: usize, const V: usize, const S: usize> {
    pub vectors: [[Lanes; D]; V],
    pub scalars: [Lanes; S],
}

impl<const D: usize, const V: usize, const S: usize> Columns<'_, D, V, S> {
    /// The values of one place.
    #[inline(always)]
    pub fn at(&self, place: usize) -> Side<D, V, S> {
        Side {
            vectors: from_fn(|v| from_fn(|d| Lanes::splat(self.vectors[v][d][place]))),
            scalars: from_fn(|s| Lanes::splat(self.scalars[s][place])),
        }
    }

    /// Calls `add` with x_i − x_j in units of ε, its square, and the values of the neighbours of a place, group by group.
    #[inline(always)]
    pub fn pairs(
        &self,
        own: &Side<D, V, S>,
        near: &Near<'_, D>,
        inverse_smoothing: f64,
        mut add: impl FnMut(&[Lanes; D], Lanes, &Side<D, V, S>),
    ) {
        for (shift, groups) in near.runs() {
            let x: [Lanes; D] = from_fn(|d| own.vectors[0][d] + Lanes::splat(shift[d] * inverse_smoothing));
            self.over(groups, |other| {
                let (dx, square) = apart(&x, &other.vectors[0]);
                add(&dx, square, other);
            });
        }
    }

    /// Calls `add` with the values of groups of places.
    #[inline(always)]
    fn over(&self, groups: &[u32], mut add: impl FnMut(&Side<D, V, S>)) {
        // Cut to one length, so that one comparison a group stands for all columns.
        let length = self.vectors[0][0].len();
        let vectors: [[&[f64]; D]; V] = from_fn(|v| from_fn(|d| &self.vectors[v][d][..length]));
        let scalars: [&[f64]; S] = from_fn(|s| &self.scalars[s][..length]);
        for first in groups {
            let at = *first as usize;
            let end = at + LANES;
            if end > length {
                return;
            }
            add(&Side {
                vectors: from_fn(|v| from_fn(|d| lanes(&vectors[v][d][at..end]))),
                scalars: from_fn(|s| lanes(&scalars[s][at..end])),
            });
        }
    }
}

#[inline(always)]
fn lanes(numbers: &[f64]) -> Lanes {
    numbers.first_chunk::<LANES>().map_or(Lanes::splat(0.0), |lanes| Lanes::new(*lanes))
}

/// Keeps the mean of two viscosities that are both zero a number.
pub(super) const TINY: f64 = 1e-300;

/// x_i − x_j in units of ε and its square.
#[inline(always)]
fn apart<const D: usize>(x: &[Lanes; D], other: &[Lanes; D]) -> ([Lanes; D], Lanes) {
    let dx: [Lanes; D] = from_fn(|d| x[d] - other[d]);
    let mut square = dx[0] * dx[0];
    for part in &dx[1..] {
        square = Number::mul_add(*part, *part, square);
    }
    (dx, square)
}

/// The sum of the lanes, in a fixed order.
#[inline(always)]
pub(super) fn total(lanes: Lanes) -> f64 {
    let [a, b, c, d] = lanes.to_array();
    (a + c) + (b + d)
}
