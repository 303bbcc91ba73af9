//! Neighbours as groups that stand side by side in memory: points of a periodic box sorted into pencils along x (stripes in the
//! plane), in each by x, so that those within reach of a point are a few contiguous ranges, cut into groups of [`GROUP`].
//!
//! A loop over groups needs no condition: the last group of a range may reach beyond it, to points that are out of reach,
//! or to places that nobody stands at, of which every pencil ends with a few. Periodic images need no copies: groups are
//! told with the period that their point is moved by to meet them. The lists hold while no point has moved by more than
//! half the skin; an order is a function of the positions that it was made of alone.

use crate::geometry::domain::Axis;
use crate::geometry::{Domain, Vector};
use crate::parallel::{Interrupt, Interrupted};
use rayon::prelude::{IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator};
use rayon::slice::ParallelSliceMut;

/// Places of a group.
pub const GROUP: usize = 4;
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

/// Groups that are met from one image of their point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Run {
    /// Behind the last group, in the groups of the block.
    end: u32,
    /// Which image: an index into the shifts.
    image: u32,
}

/// The groups of up to [`PENCIL_BLOCK`] places.
#[derive(Debug, Clone, Default)]
struct Block {
    /// First place of each group.
    groups: Vec<u32>,
    runs: Vec<Run>,
    /// Where the runs of each place end.
    ends: Vec<u32>,
}

/// The neighbours of one place: groups by image.
#[derive(Debug, Clone, Copy)]
pub struct Near<'a, const D: usize> {
    groups: &'a [u32],
    runs: &'a [Run],
    begin: u32,
    shifts: &'a [Vector<D>],
}

impl<'a, const D: usize> Near<'a, D> {
    /// Groups with the displacement of the image that they are met from: add it to the position of the point.
    pub fn runs(&self) -> impl Iterator<Item = (&'a Vector<D>, &'a [u32])> + '_ {
        let mut begin = self.begin as usize;
        self.runs.iter().map(move |run| {
            let groups = &self.groups[begin..run.end as usize];
            begin = run.end as usize;
            (&self.shifts[run.image as usize], groups)
        })
    }
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
            block.groups.clear();
            block.runs.clear();
            block.ends.clear();
            if interrupt.is_raised() {
                return;
            }
            let first = number * PENCIL_BLOCK;
            for x in &this.sorted[first..(first + PENCIL_BLOCK).min(this.sorted.len())] {
                if x[0] < f64::INFINITY {
                    this.find_groups(x, block);
                }
                block.ends.push(block.runs.len() as u32);
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
        column.resize(self.order.len() + GROUP, nobodys);
    }

    /// Calls `work` with the place, its neighbours and its slot of `out`, in parallel.
    ///
    /// # Errors
    /// [`Interrupted`] when somebody asked to stop.
    pub fn for_each_place<T: Send>(
        &self,
        out: &mut [T],
        interrupt: &Interrupt,
        work: impl Fn(usize, &Near<'_, D>, &mut T) + Sync,
    ) -> Result<(), Interrupted> {
        out.par_chunks_mut(PENCIL_BLOCK).enumerate().for_each(|(number, slots)| {
            if interrupt.is_raised() {
                return;
            }
            let Some(block) = self.blocks.get(number) else { return };
            let (mut first, mut begin) = (0, 0);
            for ((k, slot), end) in slots.iter_mut().enumerate().zip(&block.ends) {
                let runs = &block.runs[first..*end as usize];
                let near = Near { groups: &block.groups, runs, begin, shifts: &self.shifts };
                work(number * PENCIL_BLOCK + k, &near, slot);
                first = *end as usize;
                begin = runs.last().map_or(begin, |run| run.end);
            }
        });
        interrupt.check()
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
            self.starts[cell + 1] += self.starts[cell] + if pencil_ends { GROUP as u32 } else { 0 };
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
            self.starts[cell] = self.starts[cell - 1] + if pencil_ends { GROUP as u32 } else { 0 };
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

    /// The groups of everybody within reach of `x`, pencil by pencil.
    fn find_groups(&self, x: &Vector<D>, found: &mut Block) {
        let first_run = found.runs.len();
        let own: [i64; D] = std::array::from_fn(|d| {
            (((x[d] - self.low[d]) / self.edges[d]).max(0.0) as i64).min(self.counts[d] as i64 - 1)
        });
        let reaches: [i64; D] =
            std::array::from_fn(|d| if d == 0 { 0 } else { (self.reach / self.edges[d]).ceil() as i64 });
        let mut pencil: [i64; D] = std::array::from_fn(|d| own[d] - reaches[d]);
        pencil[0] = 0;
        loop {
            self.groups_of_pencil(x, &pencil, first_run, found);
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

    fn groups_of_pencil(&self, x: &Vector<D>, pencil: &[i64; D], first_run: usize, found: &mut Block) {
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
                found.groups.extend((first..end).step_by(GROUP).map(|place| place as u32));
                let all = found.groups.len() as u32;
                let is_new = found.runs.len() == first_run;
                match found.runs.last_mut() {
                    Some(run) if !is_new && run.image == image => run.end = all,
                    _ => found.runs.push(Run { end: all, image }),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Domain, GROUP, Interrupt, Pencils, Vector};
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
        let mut standing = vec![None; pencils.places() + GROUP];
        for (place, i) in pencils.occupied() {
            standing[place] = Some(i);
        }
        pencils
            .for_each_place(&mut found, &Interrupt::default(), |place, near, found| {
                for (shift, groups) in near.runs() {
                    let x = points[standing[place].unwrap()] + shift;
                    // What a group holds beyond its range is out of reach, or it would be found twice.
                    let places = groups.iter().flat_map(|first| *first..*first + GROUP as u32);
                    found.extend(
                        places
                            .filter_map(|other| standing[other as usize].filter(|j| (x - points[*j]).norm() <= reach)),
                    );
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
