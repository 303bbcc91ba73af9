//! Sums over pairs of neighbors. Each pair is met once, in the order of the neighbor lists, several pairs side by side in
//! vector lanes.

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
    /// Scalars.
    pub scalars: [&'a [f64]; S],
}

/// The values of one place in every lane, or those of several places, one in each lane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Side<const D: usize, const V: usize, const S: usize> {
    pub vectors: [[Lanes; D]; V],
    pub scalars: [Lanes; S],
}

/// A particle i and several of its neighbors j, one in each lane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair<'a, const D: usize, const V: usize, const S: usize> {
    /// Values of i.
    pub own: &'a Side<D, V, S>,
    /// Values of j.
    pub other: &'a Side<D, V, S>,
    /// x_i − x_j in units of ε.
    pub dx: &'a [Lanes; D],
    /// |x_i − x_j|² in units of ε².
    pub square: Lanes,
}

impl<const D: usize, const V: usize, const S: usize> Pair<'_, D, V, S> {
    /// The distance q = r/ε.
    #[inline(always)]
    pub fn q(&self) -> Lanes {
        Number::sqrt(self.square)
    }

    /// A scalar of i and of j.
    #[inline(always)]
    pub fn scalar(&self, slot: usize) -> (Lanes, Lanes) {
        (self.own.scalars[slot], self.other.scalars[slot])
    }

    /// The difference v_i − v_j of a vector column.
    #[inline(always)]
    pub fn difference(&self, vector: usize) -> [Lanes; D] {
        from_fn(|d| self.own.vectors[vector][d] - self.other.vectors[vector][d])
    }
}

/// What a pair adds to the sums of its two particles.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shares<const N: usize> {
    /// Added to the sums of i.
    pub own: [Lanes; N],
    /// Added to the sums of j.
    pub other: [Lanes; N],
}

impl<const N: usize> Shares<N> {
    /// Action and reaction: j gets the opposite of what i gets.
    #[inline(always)]
    pub fn opposite(own: [Lanes; N]) -> Self {
        Self { own, other: own.map(|part| -part) }
    }

    /// Both particles get the same.
    #[inline(always)]
    pub fn equal(own: [Lanes; N]) -> Self {
        Self { own, other: own }
    }
}

/// The setting of a loop over pairs.
#[derive(Debug, Clone, Copy)]
pub(super) struct PairLoop<'a, const D: usize> {
    /// The neighbor lists.
    pub pencils: &'a Pencils<D>,
    /// 1/ε.
    pub inverse_smoothing: f64,
    /// An axis and how much the first component of the second vector changes with the way of an image along it.
    pub image_shear: Option<(usize, f64)>,
    /// Ends the loop early.
    pub interrupt: &'a Interrupt,
}

impl<const D: usize> PairLoop<'_, D> {
    /// Sets `sums` to Σ_j of the shares of every pair of two different particles. Places that `meets` denies do not visit the
    /// neighbors that they list; places that list them still visit them.
    pub fn sum<const V: usize, const S: usize, const N: usize>(
        &self,
        columns: &Columns<'_, D, V, S>,
        sums: &mut [Column],
        meets: impl Fn(usize) -> bool + Sync,
        share: impl Fn(&Pair<'_, D, V, S>) -> Shares<N> + Sync,
    ) -> Result<(), Interrupted> {
        let mut slots = sums.iter_mut();
        let sums: [&mut [f64]; N] = from_fn(|_| slots.next().map_or_else(Default::default, |column| &mut column[..]));
        self.pencils.sum(sums, self.interrupt, |place, near, window| {
            if !meets(place) {
                return;
            }
            let mut own = columns.at(place);
            let mut totals = [Lanes::splat(0.0); N];
            let along = own.vectors[V - 1][0];
            for (shift, groups) in near.runs() {
                if let (Some((axis, change)), true) = (self.image_shear, V > 1) {
                    own.vectors[V - 1][0] = along + Lanes::splat(shift[axis] * change);
                }
                let x: [Lanes; D] = from_fn(|d| own.vectors[0][d] + Lanes::splat(shift[d] * self.inverse_smoothing));
                columns.over(groups, window, |other| {
                    let (dx, square) = separation(&x, &other.vectors[0]);
                    let shares = share(&Pair { own: &own, other, dx: &dx, square });
                    for (total, more) in totals.iter_mut().zip(shares.own) {
                        *total += more;
                    }
                    shares.other
                });
            }
            let place = place - window.begin;
            for (column, lanes) in window.columns.iter_mut().zip(totals) {
                column[place] += total(lanes);
            }
        })
    }
}

impl<const D: usize, const V: usize, const S: usize> Columns<'_, D, V, S> {
    /// The values of one place.
    #[inline(always)]
    fn at(&self, place: usize) -> Side<D, V, S> {
        Side {
            vectors: from_fn(|v| from_fn(|d| Lanes::splat(self.vectors[v][d][place]))),
            scalars: from_fn(|s| Lanes::splat(self.scalars[s][place])),
        }
    }

    /// Adds the shares of groups of places to their sums.
    #[inline(always)]
    fn over<const N: usize>(
        &self,
        groups: &[u32],
        window: &mut Window<'_, N>,
        mut share: impl FnMut(&Side<D, V, S>) -> [Lanes; N],
    ) {
        // Cut to one length, so that one comparison a group stands for all columns.
        let length = self.vectors[0][0].len();
        let vectors: [[&[f64]; D]; V] = from_fn(|v| from_fn(|d| &self.vectors[v][d][..length]));
        let scalars: [&[f64]; S] = from_fn(|s| &self.scalars[s][..length]);
        let slots = window.columns[0].len();
        let mut sums = window.columns.each_mut().map(|column| &mut column[..slots]);
        for first in groups {
            let at = *first as usize;
            let (end, slot) = (at + LANES, at - window.begin);
            if end > length || slot + LANES > slots {
                return;
            }
            let found = share(&Side {
                vectors: from_fn(|v| from_fn(|d| lanes(&vectors[v][d][at..end]))),
                scalars: from_fn(|s| lanes(&scalars[s][at..end])),
            });
            for (sum, more) in sums.iter_mut().zip(found) {
                let target = &mut sum[slot..slot + LANES];
                let new = lanes(target) + more;
                target.copy_from_slice(&new.to_array());
            }
        }
    }
}

#[inline(always)]
fn lanes(numbers: &[f64]) -> Lanes {
    numbers.first_chunk::<LANES>().map_or(Lanes::splat(0.0), |lanes| Lanes::new(*lanes))
}

/// x_i − x_j in units of ε and its square.
#[inline(always)]
fn separation<const D: usize>(x: &[Lanes; D], other: &[Lanes; D]) -> ([Lanes; D], Lanes) {
    let dx: [Lanes; D] = from_fn(|d| x[d] - other[d]);
    let mut square = dx[0] * dx[0];
    for part in &dx[1..] {
        square = Number::mul_add(*part, *part, square);
    }
    (dx, square)
}

/// The sum of the lanes, in a fixed order.
#[inline(always)]
fn total(lanes: Lanes) -> f64 {
    let [a, b, c, d] = lanes.to_array();
    (a + c) + (b + d)
}

/// Keeps the harmonic mean of two numbers that are both zero a number.
const TINY: f64 = 1e-300;

/// The harmonic mean 2ab/(a + b); 0 of two zeros.
#[inline(always)]
pub(super) fn harmonic_mean((a, b): (Lanes, Lanes)) -> Lanes {
    (a + a) * b / (a + b + Lanes::splat(TINY))
}

#[cfg(test)]
mod tests {
    use super::{Lanes, Shares, harmonic_mean};
    use crate::linear_algebra::number::Number;
    use crate::schemes::weakly_compressible_sph::KernelChoice;
    use crate::schemes::weakly_compressible_sph::test_setting::{Setting, setting};

    /// Neighbors have the weight (2 − q)⁺, which a loop over all pairs finds as well.
    fn weight(q: f64) -> f64 {
        (2.0 - q).max(0.0)
    }

    fn check_both_sides<const D: usize>(this: &Setting<D>) {
        let value = |i: usize| 1.0 + (i % 7) as f64;
        let mut pairs = this.gathered();
        pairs.gather(0, 0.0, value);
        pairs
            .sum_pairs::<1, 1, 2>(|pair| {
                let weight = (Lanes::splat(2.0) - pair.q()).positive_part();
                let (own, other) = pair.scalar(0);
                Shares { own: [weight * other, weight], other: [weight * own, -weight] }
            })
            .unwrap();
        let e = this.config.smoothing_length;
        let (mut all, mut sizes) = (0.0, 0.0);
        for (place, i) in pairs.occupied() {
            all += pairs.sum(1, place);
            sizes += pairs.sum(1, place).abs();
            if i.is_multiple_of(37) {
                let mut expected = 0.0;
                this.each(i, |j, _, r| expected += weight(r / e) * value(j));
                assert!((pairs.sum(0, place) - expected).abs() < 1e-11 * expected, "particle {i}");
            }
        }
        assert!(all.abs() < 1e-13 * sizes, "opposite shares cancel: {all}");
    }

    #[test]
    fn shares_reach_both_particles_of_every_pair_once() {
        check_both_sides(&setting::<2>(KernelChoice::WendlandC2, 1.0));
        check_both_sides(&setting::<3>(KernelChoice::WendlandC2, 1.0));
    }

    #[test]
    fn places_that_meet_no_neighbors_are_still_met_by_those_that_list_them() {
        let this = setting::<2>(KernelChoice::WendlandC2, 1.0);
        let mut pairs = this.gathered();
        let is_marked = |i: usize| i.is_multiple_of(3);
        pairs.gather(0, 0.0, |i| f64::from(u8::from(is_marked(i))));
        pairs
            .sum_pairs_where::<1, 1, 1>(
                |scalars, place| scalars[0][place] != 0.0,
                |pair| {
                    let (own, other) = pair.scalar(0);
                    let weight = (Lanes::splat(2.0) - pair.q()).positive_part() * own * other;
                    Shares::equal([weight])
                },
            )
            .unwrap();
        for (place, i) in pairs.occupied().filter(|(_, i)| i.is_multiple_of(37)) {
            let mut expected = 0.0;
            this.each(i, |j, _, r| {
                if is_marked(i) && is_marked(j) {
                    expected += weight(r / this.config.smoothing_length);
                }
            });
            assert!((pairs.sum(0, place) - expected).abs() < 1e-12, "particle {i}");
        }
    }

    #[test]
    fn harmonic_means_are_between_their_numbers_and_zero_of_two_zeros() {
        let mean = |a: f64, b: f64| harmonic_mean((Lanes::splat(a), Lanes::splat(b))).to_array()[0];
        assert!((mean(1.0, 3.0) - 1.5).abs() < 1e-15);
        assert_eq!((mean(0.5, 0.5), mean(0.0, 2.0), mean(0.0, 0.0)), (0.5, 0.0, 0.0));
    }
}
