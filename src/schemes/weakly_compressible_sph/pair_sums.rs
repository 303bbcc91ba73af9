//! Sums over pairs, each met once, in the order of pencils, several pairs side by side.

use super::column::Column;
use crate::linear_algebra::number::{LANES, Lanes, Number};
use crate::neighbors::Pencils;
use crate::neighbors::pencils::Window;
use crate::parallel::{Interrupt, Interrupted};
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

    /// Sets `sums` to Σ_j of what `pair` gives for both sides of each pair but a particle with itself: it is called with the
    /// values of i, those of several j, x_i − x_j in units of ε and its square.
    pub fn sum_pairs<const N: usize>(
        &self,
        pencils: &Pencils<D>,
        inverse_smoothing: f64,
        sums: &mut [Column],
        interrupt: &Interrupt,
        pair: impl Fn(&Side<D, V, S>, &Side<D, V, S>, &[Lanes; D], Lanes) -> ([Lanes; N], [Lanes; N]) + Sync,
    ) -> Result<(), Interrupted> {
        self.sum_pairs_of(pencils, inverse_smoothing, sums, interrupt, |_| true, pair)
    }

    /// The same, where places that `is_met` denies meet nobody whom they would list; one who lists them still meets them.
    pub fn sum_pairs_of<const N: usize>(
        &self,
        pencils: &Pencils<D>,
        inverse_smoothing: f64,
        sums: &mut [Column],
        interrupt: &Interrupt,
        is_met: impl Fn(usize) -> bool + Sync,
        pair: impl Fn(&Side<D, V, S>, &Side<D, V, S>, &[Lanes; D], Lanes) -> ([Lanes; N], [Lanes; N]) + Sync,
    ) -> Result<(), Interrupted> {
        let mut columns = sums.iter_mut();
        let sums: [&mut [f64]; N] = from_fn(|_| columns.next().map_or_else(Default::default, |column| &mut column[..]));
        pencils.sum(sums, interrupt, |place, near, window| {
            if !is_met(place) {
                return;
            }
            let own = self.at(place);
            let mut totals = [Lanes::splat(0.0); N];
            for (shift, groups) in near.runs() {
                let x: [Lanes; D] = from_fn(|d| own.vectors[0][d] + Lanes::splat(shift[d] * inverse_smoothing));
                self.over(groups, window, |other| {
                    let (dx, square) = apart(&x, &other.vectors[0]);
                    let (of_own, of_other) = pair(&own, other, &dx, square);
                    for (total, more) in totals.iter_mut().zip(of_own) {
                        *total += more;
                    }
                    of_other
                });
            }
            let place = place - window.begin;
            for (column, lanes) in window.columns.iter_mut().zip(totals) {
                column[place] += total(lanes);
            }
        })
    }

    /// Adds what `pair` gives for groups of places to them.
    #[inline(always)]
    fn over<const N: usize>(
        &self,
        groups: &[u32],
        window: &mut Window<'_, N>,
        mut pair: impl FnMut(&Side<D, V, S>) -> [Lanes; N],
    ) {
        // Cut to one length, so that one comparison a group stands for all columns.
        let length = self.vectors[0][0].len();
        let vectors: [[&[f64]; D]; V] = from_fn(|v| from_fn(|d| &self.vectors[v][d][..length]));
        let scalars: [&[f64]; S] = from_fn(|s| &self.scalars[s][..length]);
        let room = window.columns[0].len();
        let mut sums = window.columns.each_mut().map(|column| &mut column[..room]);
        for first in groups {
            let at = *first as usize;
            let (end, slot) = (at + LANES, at - window.begin);
            if end > length || slot + LANES > room {
                return;
            }
            let found = pair(&Side {
                vectors: from_fn(|v| from_fn(|d| lanes(&vectors[v][d][at..end]))),
                scalars: from_fn(|s| lanes(&scalars[s][at..end])),
            });
            for (sum, more) in sums.iter_mut().zip(found) {
                let slots = &mut sum[slot..slot + LANES];
                let new = lanes(slots) + more;
                slots.copy_from_slice(&new.to_array());
            }
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
