//! Surfaces that repeat: copies of the points beyond opposite edges, a period away, so that the surface goes on there.
//!
//! Stars and supports are found among the points and their copies. Then what belongs to a copy is booked on the point that it is a
//! copy of.

use super::cleaning::{Cleaned, Cleaning, clean};
use super::examination::{PointList, Unusable};
use super::local_spacing::{self, Nearest};
use super::preparation::PreparedCloud;
use super::stars::CANDIDATES;
use crate::geometry::Vector;
use crate::neighbors::KdTree;
use crate::parallel::Interrupt;

/// Copies farther than this many of the largest local spacings from all points are in no support: one of order 6 grows to 10.5.
const MARGIN: f64 = 12.0;
/// A copy closer than this fraction of the spacing to a point is at its place: the point was given on both edges.
const SAME_PLACE: f64 = 1e-3;
/// Where the surface goes on, a copy is about one spacing from a point; this many at most.
const NEAR: f64 = 2.5;

/// Points and their copies.
#[derive(Debug, Clone)]
pub struct Repeated<const D: usize> {
    /// The points, copies behind them.
    pub points: Vec<Vector<D>>,
    /// The point that each is a copy of; the points themselves come first.
    pub source: Vec<u32>,
    /// Number of points that are no copies.
    pub own: usize,
    cleaned: Cleaned,
    /// Number of given points.
    given: usize,
}

/// All sums of periods with factors −1, 0 and 1, but for nothing.
fn shifts<const D: usize>(periods: &[Vector<D>]) -> Vec<Vector<D>> {
    let mut found = vec![Vector::<D>::zeros()];
    for period in periods {
        found = found.iter().flat_map(|shift| [*shift, shift + period, shift - period]).collect();
    }
    found.remove(0);
    found
}

impl<const D: usize> Repeated<D> {
    /// Points without duplicates, strays and points that are given on both edges, with their copies.
    ///
    /// # Errors
    /// [`Unusable`], also for periods that are short beside the spacing, or after which the surface does not go on.
    pub fn new(points: &[Vector<D>], periods: &[Vector<D>], cleaning: Cleaning) -> Result<Self, Unusable> {
        let least = local_spacing::neighbors_wanted(D) + 1;
        let too_few = |count: usize| if count < least { Err(Unusable::TooFew { count, least }) } else { Ok(()) };
        too_few(points.len())?;
        let mut cleaned = clean(points, cleaning)?;
        let present: Vec<Vector<D>> = cleaned.kept.iter().map(|i| points[*i]).collect();
        too_few(present.len())?;
        let nearest = Nearest::new(&present, CANDIDATES[D - 2]);
        let spacings = local_spacing::smoothed::<D>(&local_spacing::at_each_point(&present, &nearest), &nearest);
        let spacing = spacings.iter().copied().fold(0.0, f64::max);
        if let Some(period) = periods.iter().map(Vector::norm).find(|period| *period <= MARGIN * spacing) {
            return Err(Unusable::ShortPeriod { period, least: MARGIN * spacing });
        }
        let shifts = shifts(periods);
        merge_copies(&present, &shifts, SAME_PLACE * spacing, &mut cleaned);
        let own: Vec<Vector<D>> = cleaned.kept.iter().map(|i| points[*i]).collect();
        let tree = KdTree::new(&own);
        let (mut all, mut source) = (own.clone(), (0..own.len() as u32).collect::<Vec<u32>>());
        let mut found = Vec::new();
        for shift in &shifts {
            let mut closest = f64::INFINITY;
            for (i, x) in own.iter().enumerate() {
                let copy = x + shift;
                tree.nearest(&copy, 1, &mut found);
                let distance = found.first().map_or(f64::INFINITY, |(square, _)| square.sqrt());
                closest = closest.min(distance);
                if distance <= MARGIN * spacing {
                    all.push(copy);
                    source.push(i as u32);
                }
            }
            // Sums of two periods may lead nowhere.
            let is_period = periods.iter().any(|period| (shift - period).norm() == 0.0);
            if is_period && closest > NEAR * spacing {
                return Err(Unusable::NoRepetition { closest, spacing });
            }
        }
        Ok(Self { points: all, source, own: own.len(), cleaned, given: points.len() })
    }

    /// What belongs to given points, on the points and their copies.
    #[must_use]
    pub fn spread<T: Copy>(&self, given: &[T]) -> Vec<T> {
        self.source.iter().map(|i| given[self.cleaned.kept[*i as usize]]).collect()
    }

    /// Prepares the points with their copies: the whole, and what is seen of it on the points alone.
    ///
    /// # Errors
    /// [`Unusable`] when nothing can be computed on the points.
    pub fn prepare(
        &self,
        normals: Option<&[Vector<D>]>,
        interrupt: &Interrupt,
    ) -> Result<(PreparedCloud<D>, PreparedCloud<D>), Unusable> {
        let normals = normals.map(|normals| self.spread(normals));
        let whole = PreparedCloud::with_interrupt(&self.points, normals.as_deref(), Cleaning::Off, interrupt)?;
        let own = self.own;
        let of_own = |list: &Option<PointList>| {
            let list = list.iter().flat_map(|list| list.all.iter().copied().filter(|i| *i < own));
            PointList::from_indices(list.collect())
        };
        let mut verdict = whole.verdict.clone();
        if let Some(verdict) = &mut verdict {
            verdict.replaced = of_own(&verdict.replaced);
        }
        let seen = PreparedCloud {
            points: whole.points[..own].to_vec(),
            kept: self.cleaned.kept.clone(),
            places: self.cleaned.places(self.given),
            normals: whole.normals[..own].to_vec(),
            spacings: whole.spacings[..own].to_vec(),
            graph: whole.graph.folded(own, &self.source),
            merged: self.cleaned.merged.clone(),
            dropped: self.cleaned.dropped.clone(),
            joined_sheets: of_own(&whole.joined_sheets),
            verdict,
            // Bodies that touch close on themselves, but what repeats is open.
            closed_pieces: 0,
            ..whole.clone()
        };
        Ok((whole, seen))
    }
}

/// Leaves out points at the place of a copy of another one, of the smaller index.
fn merge_copies<const D: usize>(present: &[Vector<D>], shifts: &[Vector<D>], near: f64, cleaned: &mut Cleaned) {
    let tree = KdTree::new(present);
    let mut is_out = vec![false; present.len()];
    let mut found = Vec::new();
    for i in 0..present.len() {
        for shift in shifts {
            tree.nearest(&(present[i] + shift), 1, &mut found);
            let twin = found.first().filter(|(square, j)| square.sqrt() <= near && (*j as usize) > i);
            if let Some((_, j)) = twin.filter(|_| !is_out[i])
                && !std::mem::replace(&mut is_out[*j as usize], true)
            {
                cleaned.twins.push([cleaned.kept[i], cleaned.kept[*j as usize]]);
            }
        }
    }
    let out: Vec<usize> = (0..present.len()).filter(|i| is_out[*i]).map(|i| cleaned.kept[i]).collect();
    let before = cleaned.merged.iter().flat_map(|list| list.all.iter().copied());
    cleaned.merged = PointList::from_indices(before.chain(out.iter().copied()).collect());
    cleaned.kept.retain(|i| out.binary_search(i).is_err());
}

#[cfg(test)]
mod tests {
    use super::{Cleaning, Interrupt, Repeated, Unusable, Vector};

    /// A square lattice of a patch that repeats along x; points on both edges are one.
    #[test]
    fn a_patch_becomes_a_band_without_ends() {
        let side = 30;
        let at = |k: i32| Vector::<3>::new(f64::from(k % (side + 1)), f64::from(k / (side + 1)), 0.0);
        let points: Vec<_> = (0..(side + 1) * side).map(at).collect();
        let period = Vector::<3>::new(f64::from(side), 0.0, 0.0);
        let found = Repeated::new(&points, &[period], Cleaning::Drop).unwrap();
        assert_eq!(found.own as i32, side * side);
        assert_eq!(found.cleaned.merged.as_ref().unwrap().count as i32, side);
        let (_, seen) = found.prepare(None, &Interrupt::default()).unwrap();
        // Open are the upper and the lower edge alone.
        assert_eq!(seen.graph.open_count() as i32, 2 * side);
        assert!((seen.graph.areas.iter().sum::<f64>() - f64::from(side * (side - 1))).abs() < 1e-9);
        for i in 0..found.own {
            for (j, conductance) in seen.graph.neighbors(i).iter().zip(seen.graph.conductances(i)) {
                let back = seen.graph.neighbors(*j as usize).binary_search(&(i as u32)).unwrap();
                assert_eq!(seen.graph.conductances(*j as usize)[back], *conductance);
            }
        }
        // Every given point has a place.
        assert!(seen.places.iter().all(Option::is_some));
        let far = Repeated::new(&points, &[period * 3.0], Cleaning::Drop).err().unwrap();
        assert!(matches!(far, Unusable::NoRepetition { .. }), "{far}");
        let short = Repeated::new(&points, &[period * 0.1], Cleaning::Drop).err().unwrap();
        assert!(matches!(short, Unusable::ShortPeriod { .. }), "{short}");
    }
}
