//! Neighbours as a few contiguous ranges: points of a periodic box sorted into pencils along x (stripes in the plane), so
//! that those within reach of a point stand side by side in memory, by x, in each pencil that the reach touches.
//!
//! Loops over a range need no index list and no condition: whoever reads up to [`OVERRUN`] places beyond its end finds
//! points out of reach, or places that nobody stands at, of which every pencil ends with a few. Periodic images need no copies: a range says by which period its point is moved to meet it. The lists hold while
//! no point has moved by more than half the skin; an order is a function of the positions that it was made of alone.

use crate::geometry::domain::Axis;
use crate::geometry::{Domain, Vector};
use crate::parallel::{Interrupt, Interrupted};
use rayon::prelude::{IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator};
use rayon::slice::ParallelSliceMut;

/// Places behind a range that may be read.
pub const OVERRUN: usize = 4;
/// Who stands at a place where nobody stands.
const NOBODY: u32 = u32::MAX;
/// Places of one parallel task.
pub const PENCIL_BLOCK: usize = 128;
/// Pencils that the reach spans: more follow the round support closer, fewer are longer (measured).
const fn pencils_a_reach(dimension: usize) -> f64 {
    if dimension == 2 { 3.0 } else { 2.0 }
}
/// Edge of the cells along x by the edge of a pencil.
const CELL: f64 = 0.5;

/// Places of the sorted points in reach, seen from a point moved by an image's shift.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Range {
    /// First place.
    pub from: u32,
    /// Behind the last one.
    pub to: u32,
    /// Which image: an index into [`Pencils::shift`].
    image: u32,
}

/// The ranges of up to [`PENCIL_BLOCK`] places.
#[derive(Debug, Clone, Default)]
struct Block {
    ranges: Vec<Range>,
    /// Where the ranges of each place end.
    ends: Vec<u32>,
}

/// Points of a periodic box in pencils, with the ranges in reach of each.
#[derive(Debug, Clone)]
pub struct Pencils<const D: usize> {
    low: Vector<D>,
    lengths: Vector<D>,
    /// Cells along x, pencils along the others.
    counts: [usize; D],
    edges: Vector<D>,
    reach: f64,
    starts: Vec<u32>,
    cell_of: Vec<u32>,
    order: Vec<u32>,
    /// Positions in that order.
    sorted: Vec<Vector<D>>,
    blocks: Vec<Block>,
    shifts: Vec<Vector<D>>,
}

/// A box that is too small for a reach.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("a periodic length of {length} is too short for neighbours within {reach}: {least} is needed")]
pub struct BoxTooSmall {
    /// The length.
    pub length: f64,
    /// The reach.
    pub reach: f64,
    /// What would do.
    pub least: f64,
}

impl<const D: usize> Pencils<D> {
    /// Nobody yet, in a box that is periodic along every axis, for neighbours within `reach`.
    ///
    /// # Errors
    /// [`BoxTooSmall`] where a point could meet two images of another; an axis without a period counts as length 0.
    pub fn new(domain: &Domain<D>, reach: f64) -> Result<Self, BoxTooSmall> {
        let mut low = Vector::<D>::zeros();
        let mut lengths = Vector::<D>::zeros();
        for (d, axis) in domain.axes().iter().enumerate() {
            if let Axis::Periodic { start, length } = axis {
                low[d] = *start;
                lengths[d] = *length;
            }
        }
        let edge = reach / pencils_a_reach(D);
        let least = (2.0 * pencils_a_reach(D) + 2.0) * edge;
        if let Some(length) = lengths.iter().copied().find(|length| *length < least) {
            return Err(BoxTooSmall { length, reach, least });
        }
        let counts: [usize; D] = std::array::from_fn(|d| {
            let wanted = if d == 0 { CELL * edge } else { edge };
            (lengths[d] / wanted).floor().max(1.0) as usize
        });
        let edges = Vector::<D>::from_fn(|d, _| lengths[d] / counts[d] as f64);
        let shifts = (0..3_usize.pow(D as u32))
            .map(|image| Vector::<D>::from_fn(|d, _| (image / 3_usize.pow(d as u32) % 3) as f64 - 1.0))
            .map(|turns| turns.component_mul(&lengths))
            .collect();
        Ok(Self {
            low,
            lengths,
            counts,
            edges,
            reach,
            starts: Vec::new(),
            cell_of: Vec::new(),
            order: Vec::new(),
            sorted: Vec::new(),
            blocks: Vec::new(),
            shifts,
        })
    }

    /// Sorts points, which lie in the box, and finds their ranges.
    ///
    /// # Errors
    /// [`Interrupted`] when somebody asked to stop.
    pub fn rebuild(&mut self, points: &[Vector<D>], interrupt: &Interrupt) -> Result<(), Interrupted> {
        self.sort(points);
        let mut blocks = std::mem::take(&mut self.blocks);
        blocks.resize_with(self.order.len().div_ceil(PENCIL_BLOCK), Block::default);
        let this = &*self;
        blocks.par_iter_mut().enumerate().for_each(|(number, block)| {
            block.ranges.clear();
            block.ends.clear();
            if interrupt.is_raised() {
                return;
            }
            let first = number * PENCIL_BLOCK;
            for x in &this.sorted[first..(first + PENCIL_BLOCK).min(this.sorted.len())] {
                if x[0] < f64::INFINITY {
                    this.find_ranges(x, &mut block.ranges);
                }
                block.ends.push(block.ranges.len() as u32);
            }
        });
        self.blocks = blocks;
        interrupt.check()
    }

    /// How many places there are.
    #[must_use]
    pub fn places(&self) -> usize {
        self.order.len()
    }

    /// Places and who stands there.
    pub fn occupied(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.order.iter().enumerate().filter(|(_, i)| **i != NOBODY).map(|(place, i)| (place, *i as usize))
    }

    /// Writes one number a place; `nobodys` where nobody stands and behind the last place.
    pub fn gather(&self, column: &mut Vec<f64>, nobodys: f64, value: impl Fn(usize) -> f64) {
        column.clear();
        column.extend(self.order.iter().map(|i| if *i == NOBODY { nobodys } else { value(*i as usize) }));
        column.resize(self.order.len() + OVERRUN, nobodys);
    }

    /// The displacement of the image that a range is seen from: add it to the position of the point whose range it is.
    #[must_use]
    #[inline]
    pub fn shift(&self, range: &Range) -> &Vector<D> {
        &self.shifts[range.image as usize]
    }

    /// Calls `work` with the place, its ranges and its slot of `out`, in parallel.
    ///
    /// # Errors
    /// [`Interrupted`] when somebody asked to stop.
    pub fn for_each_place<T: Send>(
        &self,
        out: &mut [T],
        interrupt: &Interrupt,
        work: impl Fn(usize, &[Range], &mut T) + Sync,
    ) -> Result<(), Interrupted> {
        out.par_chunks_mut(PENCIL_BLOCK).enumerate().for_each(|(number, slots)| {
            if interrupt.is_raised() {
                return;
            }
            let Some(block) = self.blocks.get(number) else { return };
            let mut begin = 0;
            for ((k, slot), end) in slots.iter_mut().enumerate().zip(&block.ends) {
                let end = *end as usize;
                work(number * PENCIL_BLOCK + k, &block.ranges[begin..end], slot);
                begin = end;
            }
        });
        interrupt.check()
    }

    /// Pairs of a place with a place in its ranges, over-run excluded.
    #[must_use]
    pub fn listed_pairs(&self) -> u64 {
        self.blocks.iter().flat_map(|block| &block.ranges).map(|range| u64::from(range.to - range.from)).sum()
    }

    fn cell(&self, x: &Vector<D>) -> usize {
        (0..D).rev().fold(0, |flat, d| {
            let index = ((x[d] - self.low[d]) / self.edges[d]).max(0.0) as usize;
            flat * self.counts[d] + index.min(self.counts[d] - 1)
        })
    }

    /// A counting sort by cells and by x inside each; points of equal x in the order given.
    fn sort(&mut self, points: &[Vector<D>]) {
        let cells: usize = self.counts.iter().product();
        self.starts.clear();
        self.starts.resize(cells + 1, 0);
        self.cell_of.clear();
        for x in points {
            let cell = self.cell(x);
            self.cell_of.push(cell as u32);
            self.starts[cell + 1] += 1;
        }
        // Behind the last cell of every pencil stand a few nobodies.
        for cell in 0..cells {
            let pencil_ends = (cell + 1).is_multiple_of(self.counts[0]);
            self.starts[cell + 1] += self.starts[cell] + if pencil_ends { OVERRUN as u32 } else { 0 };
        }
        self.order.clear();
        self.order.resize(self.starts[cells] as usize, NOBODY);
        for (i, cell) in self.cell_of.iter().enumerate() {
            let place = &mut self.starts[*cell as usize];
            self.order[*place as usize] = i as u32;
            *place += 1;
        }
        // The starts have become ends, short of the nobodies.
        for cell in (1..=cells).rev() {
            let pencil_ends = cell.is_multiple_of(self.counts[0]);
            self.starts[cell] = self.starts[cell - 1] + if pencil_ends { OVERRUN as u32 } else { 0 };
        }
        self.starts[0] = 0;
        for ends in self.starts.windows(2) {
            let members = &mut self.order[ends[0] as usize..ends[1] as usize];
            // Nobody goes last.
            let x_of = |i: u32| points.get(i as usize).map_or(f64::INFINITY, |x| x[0]);
            members.sort_unstable_by(|a, b| x_of(*a).total_cmp(&x_of(*b)).then(a.cmp(b)));
        }
        self.sorted.clear();
        let far = Vector::<D>::repeat(f64::INFINITY);
        self.sorted.extend(self.order.iter().map(|i| points.get(*i as usize).copied().unwrap_or(far)));
    }

    /// The ranges of everybody within reach of `x`, pencil by pencil.
    fn find_ranges(&self, x: &Vector<D>, found: &mut Vec<Range>) {
        let own: [i64; D] = std::array::from_fn(|d| {
            (((x[d] - self.low[d]) / self.edges[d]).max(0.0) as i64).min(self.counts[d] as i64 - 1)
        });
        let reaches: [i64; D] = std::array::from_fn(|d| if d == 0 { 0 } else { (self.reach / self.edges[d]).ceil() as i64 });
        let mut pencil: [i64; D] = std::array::from_fn(|d| own[d] - reaches[d]);
        pencil[0] = 0;
        loop {
            self.ranges_of_pencil(x, &pencil, found);
            let mut d = 1;
            loop {
                if d == D {
                    return;
                }
                pencil[d] += 1;
                if pencil[d] <= own[d] + reaches[d] {
                    break;
                }
                pencil[d] = own[d] - reaches[d];
                d += 1;
            }
        }
    }

    fn ranges_of_pencil(&self, x: &Vector<D>, pencil: &[i64; D], found: &mut Vec<Range>) {
        let (mut chord, mut base, mut image, mut digit) = (self.reach * self.reach, 0, 0, 1);
        for d in 1..D {
            let start = self.low[d] + pencil[d] as f64 * self.edges[d];
            let gap = (start - x[d]).max(x[d] - start - self.edges[d]).max(0.0);
            chord -= gap * gap;
            digit *= 3;
            let count = self.counts[d] as i64;
            // A pencil beyond an end is one of the other end: the point is moved by a period to meet it.
            image += digit * usize::try_from(1 - pencil[d].div_euclid(count)).unwrap_or(1);
        }
        if chord < 0.0 {
            return;
        }
        for d in (1..D).rev() {
            base = (base + pencil[d].rem_euclid(self.counts[d] as i64) as usize) * self.counts[d - 1];
        }
        let chord = chord.sqrt();
        for turn in -1..=1_i64 {
            let at = x[0] + turn as f64 * self.lengths[0];
            let (from, to) = (at - chord, at + chord);
            let (low, high) = (self.low[0], self.low[0] + self.lengths[0]);
            if to < low || from >= high {
                continue;
            }
            let last = self.counts[0] - 1;
            let cell = |x: f64| (((x - low) / self.edges[0]).max(0.0) as usize).min(last);
            let mut first = self.starts[base + cell(from)] as usize;
            let mut end = self.starts[base + cell(to) + 1] as usize;
            while first < end && self.sorted[first][0] < from {
                first += 1;
            }
            while first < end && self.sorted[end - 1][0] > to {
                end -= 1;
            }
            if first < end {
                let image = (image + (turn + 1) as usize) as u32;
                found.push(Range { from: first as u32, to: end as u32, image });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Domain, Interrupt, OVERRUN, Pencils, Vector};
    use crate::geometry::domain::Axis;
    use crate::geometry::random::CounterRandom;
    use crate::neighbors::{BruteForce, NeighborSearch};

    fn check<const D: usize>(lengths: [f64; D], count: usize, reach: f64) {
        let domain = Domain::new(std::array::from_fn(|d| Axis::Periodic { start: -0.3, length: lengths[d] }));
        let random = CounterRandom::new(7);
        let points: Vec<Vector<D>> = (0..count as i64)
            .map(|i| {
                let draw = |d: usize| 0.5 + 0.5 * random.symmetric(&[i, d as i64]);
                domain.wrap(Vector::<D>::from_fn(|d, _| -0.3 + lengths[d] * draw(d)))
            })
            .collect();
        let mut pencils = Pencils::new(&domain, reach).unwrap();
        pencils.rebuild(&points, &Interrupt::default()).unwrap();
        let mut found = vec![Vec::new(); pencils.places()];
        let mut standing = vec![None; pencils.places() + OVERRUN];
        for (place, i) in pencils.occupied() {
            standing[place] = Some(i);
        }
        pencils
            .for_each_place(&mut found, &Interrupt::default(), |place, ranges, found| {
                for range in ranges {
                    let x = points[standing[place].unwrap()] + pencils.shift(range);
                    let in_reach = |other: u32| {
                        standing[other as usize].filter(|j| (x - points[*j]).norm() <= reach)
                    };
                    found.extend((range.from..range.to).filter_map(in_reach));
                    // What a vector loop reads beyond a range is out of reach, or it would be in it.
                    assert!((range.to..range.to + OVERRUN as u32).all(|beyond| in_reach(beyond).is_none()));
                }
                found.sort_unstable();
            })
            .unwrap();
        let brute = BruteForce { domain: &domain, points: &points };
        let mut seen = 0;
        for (place, i) in pencils.occupied() {
            let mut expected = Vec::new();
            brute.for_each_within(&points[i], reach, |j, _, _| expected.push(j));
            expected.sort_unstable();
            assert_eq!(found[place], expected, "place {place}");
            seen += 1;
        }
        assert_eq!(seen, count);
    }

    #[test]
    fn ranges_hold_what_brute_force_finds() {
        check::<2>([1.0, 1.3], 500, 0.15);
        check::<2>([1.0, 0.7], 300, 0.2);
        check::<3>([1.0, 1.3, 0.9], 1500, 0.2);
    }

    #[test]
    fn a_box_that_is_too_small_is_refused() {
        let domain = Domain::new([Axis::Periodic { start: 0.0, length: 1.0 }, Axis::Unbounded]);
        assert!(Pencils::<2>::new(&domain, 0.1).is_err());
    }
}
