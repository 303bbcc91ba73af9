//! Sums over pairs in parallel, slab by slab in two colors.
//!
//! A slab is a layer of pencils across the last axis, at least as thick as the cutoff. Its points have neighbors in the
//! slab itself and in the next one only. All even slabs are summed in parallel, then all odd ones, so that no two
//! threads write to the same slot. The order of every sum is the same for any number of threads. The first slab is
//! repeated after the last one, which closes the ring.

use super::{NeighborGroups, Pencils, Slab};
use crate::parallel::{Interrupt, Interrupted};
use std::ops::Range;

/// The part of `N` columns to which a slab adds: its own slots and those of the next slab.
#[derive(Debug)]
pub struct Window<'a, const N: usize> {
    /// Slot of the first entry of the columns.
    pub begin: usize,
    /// Columns of equal length.
    pub columns: [&'a mut [f64]; N],
}

impl<const D: usize> Pencils<D> {
    /// Sets `sums`, columns with one number per slot, to what `work` adds to them.
    ///
    /// `work` is called in parallel for every slot with neighbors. It gets the slot, its neighbors and the window of
    /// its slab. Repeated slots of the first slab get equal sums.
    ///
    /// # Errors
    /// [`Interrupted`] when the interrupt is raised.
    pub fn sum<const N: usize>(
        &self,
        mut sums: [&mut [f64]; N],
        interrupt: &Interrupt,
        work: impl Fn(usize, &NeighborGroups<'_, D>, &mut Window<'_, N>) + Sync,
    ) -> Result<(), Interrupted> {
        sums.iter_mut().for_each(|column| column.fill(0.0));
        for color in 0..2 {
            let begin = self.slabs.get(color).map_or(0, |slab| slab.slots.start);
            let columns = sums.each_mut().map(|column| &mut column[begin..]);
            let slabs_of_color = self.slabs.len().saturating_sub(color).div_ceil(2);
            self.sum_slabs(color, 0..slabs_of_color, Window { begin, columns }, interrupt, &work);
        }
        let once = self.sorted.len();
        for column in sums {
            let (own, again) = column.split_at_mut(once);
            own.iter_mut().zip(&mut *again).for_each(|(sum, more)| *sum += *more);
            again.copy_from_slice(&own[..again.len()]);
        }
        interrupt.check()
    }

    /// Sums the slabs of one color: halves their range recursively, in parallel, until one slab is left.
    fn sum_slabs<const N: usize>(
        &self,
        color: usize,
        numbers: Range<usize>,
        mut window: Window<'_, N>,
        interrupt: &Interrupt,
        work: &(impl Fn(usize, &NeighborGroups<'_, D>, &mut Window<'_, N>) + Sync),
    ) {
        if numbers.len() > 1 {
            let middle = numbers.start + numbers.len() / 2;
            let cut = self.slabs[2 * middle + color].slots.start;
            let Window { begin, columns } = window;
            let mut right: [&mut [f64]; N] = std::array::from_fn(|_| Default::default());
            let mut halves = right.iter_mut();
            let left = columns.map(|column| {
                let (left, rest) = column.split_at_mut(cut - begin);
                if let Some(half) = halves.next() {
                    *half = rest;
                }
                left
            });
            rayon::join(
                || self.sum_slabs(color, numbers.start..middle, Window { begin, columns: left }, interrupt, work),
                || self.sum_slabs(color, middle..numbers.end, Window { begin: cut, columns: right }, interrupt, work),
            );
            return;
        }
        let Some(slab) = self.slabs.get(2 * numbers.start + color).filter(|_| !numbers.is_empty()) else { return };
        if interrupt.is_raised() {
            return;
        }
        let (mut first, mut begin) = (0, 0);
        for (slot, end) in slab.slots.clone().zip(&slab.ends) {
            let runs = &slab.runs[first..*end as usize];
            first = *end as usize;
            let Some(last) = runs.last() else { continue };
            work(slot, &NeighborGroups { groups: &slab.groups, runs, begin, shifts: &self.shifts }, &mut window);
            begin = last.end;
        }
    }

    /// Cuts the slots into slabs of as many layers of pencils as the cutoff can span. The last slab takes the remaining
    /// layers.
    pub(super) fn cut(&self, slabs: &mut Vec<Slab>) {
        let (layers, thickness) = (self.counts[D - 1], self.spans[D - 1].max(1) as usize);
        let layer = self.starts.len().saturating_sub(1) / layers;
        let number = (layers / thickness).max(1);
        slabs.resize_with(number, Slab::default);
        for (k, slab) in slabs.iter_mut().enumerate() {
            let last = if k + 1 == number { layers } else { (k + 1) * thickness };
            slab.slots = self.starts[k * thickness * layer] as usize..self.starts[last * layer] as usize;
        }
    }
}
