//! Lists of neighbor pairs for sums in vector lanes.
//!
//! The points of a periodic box are sorted into pencils along x (stripes in the plane), and by x within each pencil.
//! The neighbors of a point are then a few contiguous ranges of slots, which are cut into groups of [`GROUP`] slots.
//! Each pair is listed once, by the point that comes first in the order. The box is closed to a ring along its last
//! axis. A sum adds to both points of a pair.
//!
//! A loop over groups needs no condition. The last group of a range may contain points beyond the cutoff, whose kernel
//! is zero, or padding slots, with which every pencil ends. Periodic images are not copied: a group comes with the
//! period by which its point must be shifted. A list is valid while no point has moved by more than half the skin. The
//! order depends only on the positions from which it was built. In a sheared box images slide along x: a list holds for
//! any displacement by which the points still are neighbors.

use crate::geometry::domain::Axis;
use crate::geometry::{Domain, Vector};
use crate::parallel::{Interrupt, Interrupted};
use rayon::prelude::{IntoParallelRefMutIterator, ParallelIterator};
use std::ops::Range;

mod slabs;

pub use slabs::Window;

/// Number of slots in a group.
pub const GROUP: usize = 4;
/// Index that marks a padding slot.
const EMPTY_SLOT: u32 = u32::MAX;
/// Number of pencils per cutoff radius. More pencils follow the round support more closely, fewer are longer. The
/// values are measured.
const fn pencils_per_cutoff(dimension: usize) -> f64 {
    if dimension == 2 { 3.0 } else { 2.0 }
}
/// Ratio of the edge of a cell along x to the edge of a pencil.
const CELL: f64 = 0.5;

/// Consecutive groups that are paired with the same periodic image of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Run {
    /// End of the groups of this run in the list of the slab.
    end: u32,
    /// The image, as an index into the shifts.
    image: u32,
}

/// The neighbor lists of the slots of a slab.
#[derive(Debug, Clone, Default)]
struct Slab {
    /// Slots of the slab.
    slots: Range<usize>,
    /// First slot of each group, for all slots of the slab one after another.
    groups: Vec<u32>,
    /// The groups of each slot by image.
    runs: Vec<Run>,
    /// End of the runs of each slot.
    ends: Vec<u32>,
}

/// The neighbors that one slot lists, as groups by image.
#[derive(Debug, Clone, Copy)]
pub struct NeighborGroups<'a, const D: usize> {
    groups: &'a [u32],
    runs: &'a [Run],
    begin: u32,
    shifts: &'a [Vector<D>],
}

impl<'a, const D: usize> NeighborGroups<'a, D> {
    /// Groups (by their first slots), each with the shift to add to the position of the point.
    pub fn runs(&self) -> impl Iterator<Item = (&'a Vector<D>, &'a [u32])> + '_ {
        let mut begin = self.begin as usize;
        self.runs.iter().map(move |run| {
            let groups = &self.groups[begin..run.end as usize];
            begin = run.end as usize;
            (&self.shifts[run.image as usize], groups)
        })
    }
}

/// Points of a periodic box, sorted into pencils, with the list of neighbor pairs.
///
/// ```
/// use meniscus::geometry::{Domain, Vector, domain::Axis};
/// use meniscus::{neighbors::Pencils, parallel::Interrupt};
///
/// let domain = Domain::new([Axis::Periodic { start: 0.0, length: 1.0 }; 2]);
/// let mut pencils = Pencils::<2>::new(&domain, 0.1).unwrap();
/// pencils.rebuild(&[Vector::<2>::new(0.5, 0.5), Vector::<2>::new(0.55, 0.5)], &Interrupt::default()).unwrap();
/// assert_eq!(pencils.occupied().count(), 2);
/// ```
#[derive(Debug, Clone)]
pub struct Pencils<const D: usize> {
    /// Lower corner of the box.
    low: Vector<D>,
    /// Edge lengths of the box.
    lengths: Vector<D>,
    /// Number of cells along x, and of pencils along the other axes.
    counts: [usize; D],
    /// Edge lengths of the cells.
    edges: Vector<D>,
    /// Radius within which points are neighbors.
    cutoff: f64,
    /// Number of pencils along each axis that the cutoff radius can span.
    spans: [i64; D],
    /// First slot of each cell.
    starts: Vec<u32>,
    /// Cell of each point.
    cell_of: Vec<u32>,
    /// Index of the point in each slot; the slots of the first slab are repeated at the end.
    order: Vec<u32>,
    /// Position of the point in each slot, without the repeated slab.
    sorted: Vec<Vector<D>>,
    slabs: Vec<Slab>,
    /// Displacements of the periodic images.
    shifts: Vec<Vector<D>>,
    /// How far the image a period up along each axis is displaced along x, at most half of its length when lists are made.
    slides: Vector<D>,
}

/// The box is too small for the cutoff radius.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the periodic length {length} is too short for neighbors within {cutoff}; it must be at least {least}")]
pub struct BoxTooSmall {
    /// Length of the period, 0 for an axis that is not periodic.
    pub length: f64,
    /// Cutoff radius.
    pub cutoff: f64,
    /// Smallest length that suffices.
    pub least: f64,
}

impl<const D: usize> Pencils<D> {
    /// Empty pencils in a box that is periodic along every axis, for neighbors within `cutoff`.
    ///
    /// # Errors
    /// [`BoxTooSmall`] when a point could be a neighbor of two images of another point. An axis that is not periodic
    /// counts as length 0.
    pub fn new(domain: &Domain<D>, cutoff: f64) -> Result<Self, BoxTooSmall> {
        let mut low = Vector::<D>::zeros();
        let mut lengths = Vector::<D>::zeros();
        for (d, axis) in domain.axes().iter().enumerate() {
            if let Axis::Periodic { start, length } = axis {
                low[d] = *start;
                lengths[d] = *length;
            }
        }
        let edge = cutoff / pencils_per_cutoff(D);
        let least = (2.0 * pencils_per_cutoff(D) + 2.0) * edge;
        if let Some(length) = lengths.iter().copied().find(|length| *length < least) {
            return Err(BoxTooSmall { length, cutoff, least });
        }
        let counts: [usize; D] = std::array::from_fn(|d| {
            let wanted = if d == 0 { CELL * edge } else { edge };
            (lengths[d] / wanted).floor().max(1.0) as usize
        });
        let edges = Vector::<D>::from_fn(|d, _| lengths[d] / counts[d] as f64);
        let spans = std::array::from_fn(|d| if d == 0 { 0 } else { (cutoff / edges[d]).ceil() as i64 });
        let mut pencils = Self {
            low,
            lengths,
            counts,
            edges,
            cutoff,
            spans,
            starts: Vec::new(),
            cell_of: Vec::new(),
            order: Vec::new(),
            sorted: Vec::new(),
            slabs: Vec::new(),
            shifts: Vec::new(),
            slides: Vector::<D>::zeros(),
        };
        pencils.slide(0, 0.0);
        Ok(pencils)
    }

    /// Displaces the images a period up along an axis by `offset` along x.
    pub fn slide(&mut self, axis: usize, offset: f64) {
        self.slides[axis] = offset;
        let (lengths, slides) = (self.lengths, self.slides);
        self.shifts.clear();
        self.shifts.extend((0..3_usize.pow(D as u32)).map(|image| {
            let turns = Vector::<D>::from_fn(|d, _| (image / 3_usize.pow(d as u32) % 3) as f64 - 1.0);
            let mut shift = turns.component_mul(&lengths);
            shift[0] += turns.dot(&slides);
            shift
        }));
    }

    /// Sorts points, which must lie in the box, and lists their neighbors.
    ///
    /// # Errors
    /// [`Interrupted`] when the interrupt is raised.
    pub fn rebuild(&mut self, points: &[Vector<D>], interrupt: &Interrupt) -> Result<(), Interrupted> {
        self.sort(points);
        let mut slabs = std::mem::take(&mut self.slabs);
        self.cut(&mut slabs);
        let this = &*self;
        slabs.par_iter_mut().for_each(|slab| {
            slab.groups.clear();
            slab.runs.clear();
            slab.ends.clear();
            if interrupt.is_raised() {
                return;
            }
            for slot in slab.slots.clone() {
                if this.order[slot] != EMPTY_SLOT {
                    this.find_groups(slot, slab);
                }
                slab.ends.push(slab.runs.len() as u32);
            }
        });
        let again = slabs.first().map_or(0, |slab| slab.slots.end);
        self.order.extend_from_within(..again);
        self.slabs = slabs;
        interrupt.check()
    }

    /// Number of slots; those of the first slab are counted twice.
    #[must_use]
    pub fn slot_count(&self) -> usize {
        self.order.len()
    }

    /// Slots that contain a point, each with the index of its point.
    pub fn occupied(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let once = self.order.iter().take(self.sorted.len()).enumerate();
        once.filter(|(_, i)| **i != EMPTY_SLOT).map(|(slot, i)| (slot, *i as usize))
    }

    /// One number per slot: `value` of the point's index, or `padding` in padding slots.
    pub fn by_slot(&self, padding: f64, value: impl Fn(usize) -> f64) -> impl Iterator<Item = f64> {
        self.order.iter().map(move |i| if *i == EMPTY_SLOT { padding } else { value(*i as usize) })
    }

    /// Number of the cell that contains `x`.
    fn cell(&self, x: &Vector<D>) -> usize {
        (0..D).rev().fold(0, |flat, d| {
            let index = ((x[d] - self.low[d]) / self.edges[d]).max(0.0) as usize;
            flat * self.counts[d] + index.min(self.counts[d] - 1)
        })
    }

    /// A counting sort by cells, and by x within each cell. Points with equal x keep their order.
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
        // Each pencil ends with one group of padding slots.
        for cell in 0..cells {
            let pencil_ends = (cell + 1).is_multiple_of(self.counts[0]);
            self.starts[cell + 1] += self.starts[cell] + if pencil_ends { GROUP as u32 } else { 0 };
        }
        self.order.clear();
        self.order.resize(self.starts[cells] as usize, EMPTY_SLOT);
        for (i, cell) in self.cell_of.iter().enumerate() {
            let slot = &mut self.starts[*cell as usize];
            self.order[*slot as usize] = i as u32;
            *slot += 1;
        }
        // The starts have become ends, without the padding. They are shifted back.
        for cell in (1..=cells).rev() {
            let pencil_ends = cell.is_multiple_of(self.counts[0]);
            self.starts[cell] = self.starts[cell - 1] + if pencil_ends { GROUP as u32 } else { 0 };
        }
        self.starts[0] = 0;
        for ends in self.starts.windows(2) {
            let members = &mut self.order[ends[0] as usize..ends[1] as usize];
            // Padding slots sort last.
            let x_of = |i: u32| points.get(i as usize).map_or(f64::INFINITY, |x| x[0]);
            members.sort_unstable_by(|a, b| x_of(*a).total_cmp(&x_of(*b)).then(a.cmp(b)));
        }
        self.sorted.clear();
        let far = Vector::<D>::repeat(f64::INFINITY);
        self.sorted.extend(self.order.iter().map(|i| points.get(*i as usize).copied().unwrap_or(far)));
    }

    /// Lists the neighbors of a slot that come later in the order, pencil by pencil.
    fn find_groups(&self, slot: usize, found: &mut Slab) {
        let first_run = found.runs.len();
        let x = &self.sorted[slot];
        let own: [i64; D] = std::array::from_fn(|d| {
            (((x[d] - self.low[d]) / self.edges[d]).max(0.0) as i64).min(self.counts[d] as i64 - 1)
        });
        // First the rest of the slot's own pencil. Then those pencils whose offset is positive along the last axis
        // where it is not zero.
        let mut offset = [0; D];
        loop {
            self.add_pencil(slot, &own, &offset, first_run, found);
            let mut d = 1;
            loop {
                if d == D {
                    return;
                }
                offset[d] += 1;
                if offset[d] <= self.spans[d] {
                    break;
                }
                // With a positive offset along a later axis, this one also takes negative values.
                offset[d] = -self.spans[d];
                d += 1;
            }
        }
    }

    /// Lists the neighbors of a slot in one pencil.
    ///
    /// - `own`: indices of the slot's own pencil.
    /// - `offset`: the other pencil relative to it.
    /// - `first_run`: first run of this slot in `found`.
    fn add_pencil(&self, slot: usize, own: &[i64; D], offset: &[i64; D], first_run: usize, found: &mut Slab) {
        let x = &self.sorted[slot];
        let is_own = offset.iter().all(|steps| *steps == 0);
        let (mut chord, mut slide, mut base, mut image, mut digit) = (self.cutoff * self.cutoff, 0.0, 0, 0, 1);
        for d in 1..D {
            let pencil = own[d] + offset[d];
            let start = self.low[d] + pencil as f64 * self.edges[d];
            let gap = (start - x[d]).max(x[d] - start - self.edges[d]).max(0.0);
            chord -= gap * gap;
            digit *= 3;
            let count = self.counts[d] as i64;
            // A pencil beyond one end of the box is one at the other end: the point is shifted by a period.
            let turns = -pencil.div_euclid(count);
            image += digit * usize::try_from(1 + turns).unwrap_or(1);
            slide += turns as f64 * self.slides[d];
        }
        if chord < 0.0 {
            return;
        }
        for d in (1..D).rev() {
            let pencil = (own[d] + offset[d]).rem_euclid(self.counts[d] as i64) as usize;
            base = (base + pencil) * self.counts[d - 1];
        }
        // The first slab is repeated after the last one.
        let is_repeated = own[D - 1] + offset[D - 1] >= self.counts[D - 1] as i64;
        let shift = if is_repeated && D > 1 { self.sorted.len() } else { 0 };
        let chord = chord.sqrt();
        // In its own pencil a point lists the points to its right and, across the periodic end, those at the left.
        for turn in if is_own { -1..=0_i64 } else { -1..=1 } {
            let at = x[0] + slide + turn as f64 * self.lengths[0];
            let (from, to) = (at - chord, at + chord);
            let (low, high) = (self.low[0], self.low[0] + self.lengths[0]);
            if to < low || from >= high {
                continue;
            }
            let last = self.counts[0] - 1;
            let cell = |x: f64| (((x - low) / self.edges[0]).max(0.0) as usize).min(last);
            let mut first = self.starts[base + cell(from)] as usize;
            let mut end = self.starts[base + cell(to) + 1] as usize;
            if is_own && turn == 0 {
                first = slot + 1;
            }
            while first < end && self.sorted[first][0] < from {
                first += 1;
            }
            while first < end && self.sorted[end - 1][0] > to {
                end -= 1;
            }
            if first < end {
                let image = (image + (turn + 1) as usize) as u32;
                found.groups.extend((first..end).step_by(GROUP).map(|first| (first + shift) as u32));
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
    use super::{Domain, EMPTY_SLOT, GROUP, Interrupt, Pencils, Vector};
    use crate::geometry::domain::Axis;
    use crate::geometry::random::CounterRandom;
    use crate::neighbors::{BruteForce, NeighborSearch};
    use std::sync::Mutex;

    fn check<const D: usize>(lengths: [f64; D], count: usize, cutoff: f64) {
        let domain = Domain::new(std::array::from_fn(|d| Axis::Periodic { start: -0.3, length: lengths[d] }));
        check_in(&domain, lengths, count, cutoff);
    }

    fn check_in<const D: usize>(domain: &Domain<D>, lengths: [f64; D], count: usize, cutoff: f64) {
        let random = CounterRandom::new(7);
        let points: Vec<Vector<D>> = (0..count as i64)
            .map(|i| {
                let draw = |d: usize| 0.5 + 0.5 * random.symmetric(&[i, d as i64]);
                domain.wrap(Vector::<D>::from_fn(|d, _| -0.3 + lengths[d] * draw(d)))
            })
            .collect();
        let mut pencils = Pencils::new(domain, cutoff).unwrap();
        if let Some(tilt) = domain.tilt() {
            pencils.slide(tilt.axis, tilt.offset);
        }
        pencils.rebuild(&points, &Interrupt::default()).unwrap();
        let points_in_slots: Vec<Option<usize>> =
            pencils.order.iter().map(|i| (*i != EMPTY_SLOT).then_some(*i as usize)).collect();
        let met = Mutex::new(Vec::new());
        let mut sums = vec![0.0; pencils.slot_count()];
        pencils
            .sum([&mut sums], &Interrupt::default(), |slot, near, window| {
                let i = points_in_slots[slot].unwrap();
                for (shift, groups) in near.runs() {
                    let x = points[i] + shift;
                    // A point that a group contains beyond its range is farther away than the cutoff. Otherwise it
                    // would be found twice.
                    for other in groups.iter().flat_map(|first| *first as usize..*first as usize + GROUP) {
                        if let Some(j) = points_in_slots[other].filter(|j| (x - points[*j]).norm() <= cutoff) {
                            met.lock().unwrap().push((i.min(j), i.max(j)));
                            window.columns[0][slot - window.begin] += 1.0;
                            window.columns[0][other - window.begin] += 1.0;
                        }
                    }
                }
            })
            .unwrap();
        let brute = BruteForce { domain, points: &points };
        let mut expected = Vec::new();
        for (slot, i) in pencils.occupied() {
            let mut neighbors = 0;
            brute.for_each_within(&points[i], cutoff, |j, _, _| {
                neighbors += usize::from(j != i);
                if i < j {
                    expected.push((i, j));
                }
            });
            assert_eq!(sums[slot], neighbors as f64, "slot {slot}");
        }
        let mut met = met.into_inner().unwrap();
        met.sort_unstable();
        expected.sort_unstable();
        assert_eq!(met, expected);
        assert_eq!(pencils.occupied().count(), count);
    }

    #[test]
    fn every_pair_is_met_once() {
        check::<2>([1.0, 1.3], 500, 0.15);
        check::<2>([1.0, 0.7], 300, 0.2);
        check::<2>([0.9, 2.3], 700, 0.2);
        check::<3>([1.0, 1.3, 0.9], 1500, 0.2);
    }

    #[test]
    fn in_a_sheared_box_every_pair_is_met_once() {
        for offset in [0.2, -0.45, 0.5] {
            let axes = |lengths: [f64; 2]| Domain::new(lengths.map(|length| Axis::Periodic { start: -0.3, length }));
            check_in::<2>(&axes([1.0, 1.3]).tilted(1, offset), [1.0, 1.3], 500, 0.15);
            check_in::<2>(&axes([1.0, 0.7]).tilted(1, offset), [1.0, 0.7], 300, 0.2);
            let lengths = [1.0, 1.3, 0.9];
            let domain = Domain::new(lengths.map(|length| Axis::Periodic { start: -0.3, length }));
            check_in::<3>(&domain.tilted(1, offset), lengths, 1000, 0.2);
            check_in::<3>(&domain.tilted(2, offset), lengths, 1000, 0.2);
        }
    }

    #[test]
    fn a_box_that_is_too_small_is_refused() {
        let domain = Domain::new([Axis::Periodic { start: 0.0, length: 1.0 }, Axis::Unbounded]);
        assert!(Pencils::<2>::new(&domain, 0.1).is_err());
    }
}
