//! Pairs of neighbors, each once, as groups that stand side by side in memory: points of a periodic box sorted into pencils
//! along x (stripes in the plane), in each by x, so that those within reach of a point are a few contiguous ranges, cut into
//! groups of [`GROUP`]. Of two neighbors the one that stands earlier in the order lists the other, the box being closed to a
//! ring along its last axis: sums go to both sides of a pair.
//!
//! A loop over groups needs no condition: the last group of a range may reach beyond it, to points that are out of reach,
//! or to places that nobody stands at, of which every pencil ends with a few. Periodic images need no copies: groups are
//! told with the period that their point is moved by to meet them. The lists hold while no point has moved by more than
//! half the skin; an order is a function of the positions that it was made of alone.

use crate::geometry::domain::Axis;
use crate::geometry::{Domain, Vector};
use crate::parallel::{Interrupt, Interrupted};
use rayon::prelude::{IntoParallelRefMutIterator, ParallelIterator};
use std::ops::Range;

mod slabs;

pub use slabs::Window;

/// Places of a group.
pub const GROUP: usize = 4;
/// Who stands at a place where nobody stands.
const EMPTY_SLOT: u32 = u32::MAX;
/// Pencils that the reach spans: more follow the round support closer, fewer are longer (measured).
const fn pencils_per_cutoff(dimension: usize) -> f64 {
    if dimension == 2 { 3.0 } else { 2.0 }
}
/// Edge of the cells along x by the edge of a pencil.
const CELL: f64 = 0.5;

/// Groups that are met from one image of their point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Run {
    /// Behind the last group, in the groups of the slab.
    end: u32,
    /// Which image: an index into the shifts.
    image: u32,
}

/// The groups of the places of a slab.
#[derive(Debug, Clone, Default)]
struct Slab {
    places: Range<usize>,
    /// First place of each group.
    groups: Vec<u32>,
    runs: Vec<Run>,
    /// Where the runs of each place end.
    ends: Vec<u32>,
}

/// The neighbors that one place lists: groups by image.
#[derive(Debug, Clone, Copy)]
pub struct NeighborGroups<'a, const D: usize> {
    groups: &'a [u32],
    runs: &'a [Run],
    begin: u32,
    shifts: &'a [Vector<D>],
}

impl<'a, const D: usize> NeighborGroups<'a, D> {
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
    cutoff: f64,
    /// Pencils along every axis that the reach may span.
    spans: [i64; D],
    starts: Vec<u32>,
    cell_of: Vec<u32>,
    /// Who stands where; those of the first slab twice.
    order: Vec<u32>,
    /// Positions in that order, once.
    sorted: Vec<Vector<D>>,
    slabs: Vec<Slab>,
    shifts: Vec<Vector<D>>,
}

/// A box that is too small for a reach.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("a periodic length of {length} is too short for neighbors within {cutoff}: {least} is needed")]
pub struct BoxTooSmall {
    /// The length.
    pub length: f64,
    /// The reach.
    pub cutoff: f64,
    /// What would do.
    pub least: f64,
}

impl<const D: usize> Pencils<D> {
    /// Nobody yet, in a box that is periodic along every axis, for neighbors within `reach`.
    ///
    /// # Errors
    /// [`BoxTooSmall`] where a point could meet two images of another; an axis without a period counts as length 0.
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
        let shifts = (0..3_usize.pow(D as u32))
            .map(|image| Vector::<D>::from_fn(|d, _| (image / 3_usize.pow(d as u32) % 3) as f64 - 1.0))
            .map(|turns| turns.component_mul(&lengths))
            .collect();
        Ok(Self {
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
            shifts,
        })
    }

    /// Sorts points, which lie in the box, and finds their ranges.
    ///
    /// # Errors
    /// [`Interrupted`] when somebody asked to stop.
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
            for place in slab.places.clone() {
                if this.order[place] != EMPTY_SLOT {
                    this.find_groups(place, slab);
                }
                slab.ends.push(slab.runs.len() as u32);
            }
        });
        let again = slabs.first().map_or(0, |slab| slab.places.end);
        self.order.extend_from_within(..again);
        self.slabs = slabs;
        interrupt.check()
    }

    /// How many places there are, those of the first slab counted twice.
    #[must_use]
    pub fn slot_count(&self) -> usize {
        self.order.len()
    }

    /// Places and who stands there.
    pub fn occupied(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let once = self.order.iter().take(self.sorted.len()).enumerate();
        once.filter(|(_, i)| **i != EMPTY_SLOT).map(|(place, i)| (place, *i as usize))
    }

    /// One number a place; `nobodys` where nobody stands.
    pub fn by_slot(&self, padding: f64, value: impl Fn(usize) -> f64) -> impl Iterator<Item = f64> {
        self.order.iter().map(move |i| if *i == EMPTY_SLOT { padding } else { value(*i as usize) })
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
        self.order.resize(self.starts[cells] as usize, EMPTY_SLOT);
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

    /// The groups of everybody behind a place within its reach, pencil by pencil.
    fn find_groups(&self, place: usize, found: &mut Slab) {
        let first_run = found.runs.len();
        let x = &self.sorted[place];
        let own: [i64; D] = std::array::from_fn(|d| {
            (((x[d] - self.low[d]) / self.edges[d]).max(0.0) as i64).min(self.counts[d] as i64 - 1)
        });
        // The rest of its own pencil first, then those that differ upwards along the last axis that they differ along.
        let mut away = [0; D];
        loop {
            self.groups_of_pencil(place, &own, &away, first_run, found);
            let mut d = 1;
            loop {
                if d == D {
                    return;
                }
                away[d] += 1;
                if away[d] <= self.spans[d] {
                    break;
                }
                // Backwards along this axis where a later one goes upwards.
                away[d] = -self.spans[d];
                d += 1;
            }
        }
    }

    fn groups_of_pencil(&self, place: usize, own: &[i64; D], away: &[i64; D], first_run: usize, found: &mut Slab) {
        let x = &self.sorted[place];
        let is_own = away.iter().all(|steps| *steps == 0);
        let (mut chord, mut base, mut image, mut digit) = (self.cutoff * self.cutoff, 0, 0, 1);
        for d in 1..D {
            let pencil = own[d] + away[d];
            let start = self.low[d] + pencil as f64 * self.edges[d];
            let gap = (start - x[d]).max(x[d] - start - self.edges[d]).max(0.0);
            chord -= gap * gap;
            digit *= 3;
            let count = self.counts[d] as i64;
            // A pencil beyond an end is one of the other end: the point is moved by a period to meet it.
            image += digit * usize::try_from(1 - pencil.div_euclid(count)).unwrap_or(1);
        }
        if chord < 0.0 {
            return;
        }
        for d in (1..D).rev() {
            let pencil = (own[d] + away[d]).rem_euclid(self.counts[d] as i64) as usize;
            base = (base + pencil) * self.counts[d - 1];
        }
        // Beyond the last slab the first one stands again.
        let is_round = own[D - 1] + away[D - 1] >= self.counts[D - 1] as i64;
        let round = if is_round && D > 1 { self.sorted.len() } else { 0 };
        let chord = chord.sqrt();
        // In its own pencil a point lists those to the right of it, and round the end those at the left.
        for turn in if is_own { -1..=0_i64 } else { -1..=1 } {
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
            if is_own && turn == 0 {
                first = place + 1;
            }
            while first < end && self.sorted[first][0] < from {
                first += 1;
            }
            while first < end && self.sorted[end - 1][0] > to {
                end -= 1;
            }
            if first < end {
                let image = (image + (turn + 1) as usize) as u32;
                found.groups.extend((first..end).step_by(GROUP).map(|first| (first + round) as u32));
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
        let random = CounterRandom::new(7);
        let points: Vec<Vector<D>> = (0..count as i64)
            .map(|i| {
                let draw = |d: usize| 0.5 + 0.5 * random.symmetric(&[i, d as i64]);
                domain.wrap(Vector::<D>::from_fn(|d, _| -0.3 + lengths[d] * draw(d)))
            })
            .collect();
        let mut pencils = Pencils::new(&domain, cutoff).unwrap();
        pencils.rebuild(&points, &Interrupt::default()).unwrap();
        let standing: Vec<Option<usize>> =
            pencils.order.iter().map(|i| (*i != EMPTY_SLOT).then_some(*i as usize)).collect();
        let met = Mutex::new(Vec::new());
        let mut sums = vec![0.0; pencils.slot_count()];
        pencils
            .sum([&mut sums], &Interrupt::default(), |place, near, window| {
                let i = standing[place].unwrap();
                for (shift, groups) in near.runs() {
                    let x = points[i] + shift;
                    // What a group holds beyond its range is out of reach, or it would be found twice.
                    for other in groups.iter().flat_map(|first| *first as usize..*first as usize + GROUP) {
                        if let Some(j) = standing[other].filter(|j| (x - points[*j]).norm() <= cutoff) {
                            met.lock().unwrap().push((i.min(j), i.max(j)));
                            window.columns[0][place - window.begin] += 1.0;
                            window.columns[0][other - window.begin] += 1.0;
                        }
                    }
                }
            })
            .unwrap();
        let brute = BruteForce { domain: &domain, points: &points };
        let mut expected = Vec::new();
        for (place, i) in pencils.occupied() {
            let mut neighbors = 0;
            brute.for_each_within(&points[i], cutoff, |j, _, _| {
                neighbors += usize::from(j != i);
                if i < j {
                    expected.push((i, j));
                }
            });
            assert_eq!(sums[place], neighbors as f64, "place {place}");
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
    fn a_box_that_is_too_small_is_refused() {
        let domain = Domain::new([Axis::Periodic { start: 0.0, length: 1.0 }, Axis::Unbounded]);
        assert!(Pencils::<2>::new(&domain, 0.1).is_err());
    }
}
