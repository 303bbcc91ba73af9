//! Sums over pairs, gathered particle by particle in the order of pencils, several pairs side by side.

use crate::linear_algebra::number::{LANES, Lanes, Number};
use crate::neighbors::pencils::Range;
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

impl<'a, const D: usize, const V: usize, const S: usize> Columns<'a, D, V, S> {
    /// The values of one place.
    #[inline(always)]
    pub fn at(&self, place: usize) -> Side<D, V, S> {
        Side {
            vectors: from_fn(|v| from_fn(|d| Lanes::splat(self.vectors[v][d][place]))),
            scalars: from_fn(|s| Lanes::splat(self.scalars[s][place])),
        }
    }

    /// Calls `add` with the values of a range, [`LANES`] places at a time and up to three places behind its end.
    #[inline(always)]
    pub fn over(&self, range: &Range, mut add: impl FnMut(&Side<D, V, S>)) {
        let (from, to) = (range.from as usize, range.to as usize);
        let end = from + (to - from).next_multiple_of(LANES);
        let first = self.vectors[0][0][from..end].as_chunks::<LANES>().0;
        // Of one length, as the compiler can see, so that nothing is checked in the loop.
        let part = |column: &'a [f64]| &column[from..end].as_chunks::<LANES>().0[..first.len()];
        let vectors: [[&[[f64; LANES]]; D]; V] = from_fn(|v| from_fn(|d| part(self.vectors[v][d])));
        let scalars: [&[[f64; LANES]]; S] = from_fn(|s| part(self.scalars[s]));
        for k in 0..first.len() {
            add(&Side {
                vectors: from_fn(|v| from_fn(|d| Lanes::new(vectors[v][d][k]))),
                scalars: from_fn(|s| Lanes::new(scalars[s][k])),
            });
        }
    }
}

/// x_i − x_j in units of ε and its square.
#[inline(always)]
pub(super) fn apart<const D: usize>(x: &[Lanes; D], other: &[Lanes; D]) -> ([Lanes; D], Lanes) {
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
