//! Points that a cloud from outside is better without: points that coincide with others, and strays.

use super::examination::{PointList, Unusable};
use super::local_spacing::{self, Nearest, median};
use crate::geometry::Vector;
use crate::neighbors::KdTree;
use std::cmp::Ordering;

/// What happens to points that coincide with others, and to strays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cleaning {
    /// They are left out and counted.
    Drop,
    /// A cloud with such points is refused.
    Refuse,
    /// They are kept.
    Off,
}

/// Points coincide when their distance is below this fraction of the local spacing.
const SAME_POINT: f64 = 1e-3;
/// A stray is farther from its third neighbor than this multiple of the median spacing, and of the spacing there. Of independent
/// random points one in 1e16 is so far away.
const FAR: f64 = 4.0;
/// Distance to its third peer, by that to its third neighbor, beyond which a point is no part of a sparse region.
const SPARSE: f64 = 2.5;
/// Rounds of a search at most. A round finds all points but those that hide others.
const ROUNDS: usize = 16;

/// A cloud without the points that were left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Cleaned {
    /// Indices of the points that stay, ascending.
    pub kept: Vec<usize>,
    /// Points left out because one with a smaller index lies at their place.
    pub merged: Option<PointList>,
    /// Strays left out.
    pub dropped: Option<PointList>,
    /// Each point that was merged, after the one that stands for it.
    pub twins: Vec<[usize; 2]>,
}

/// Finds points that coincide with one of a smaller index, then strays.
///
/// # Errors
/// [`Unusable::Duplicates`] or [`Unusable::Strays`] where such points are refused.
pub fn clean<const D: usize>(points: &[Vector<D>], cleaning: Cleaning) -> Result<Cleaned, Unusable> {
    let mut kept: Vec<usize> = (0..points.len()).collect();
    if cleaning == Cleaning::Off {
        return Ok(Cleaned { kept, merged: None, dropped: None, twins: Vec::new() });
    }
    let mut twins = equal_points(points);
    remove(&mut kept, &twins.iter().map(|pair| pair[1]).collect::<Vec<_>>());
    let neighbors = local_spacing::neighbors_wanted(D);
    let mut dropped = Vec::new();
    for is_search_for_strays in [false, true] {
        for _ in 0..ROUNDS {
            if kept.len() <= neighbors {
                break;
            }
            let present: Vec<Vector<D>> = kept.iter().map(|i| points[*i]).collect();
            let nearest = Nearest::new(&present, neighbors);
            let spacing = local_spacing::at_each_point(&present, &nearest);
            let found: Vec<usize> = if is_search_for_strays {
                let found: Vec<usize> =
                    strays(&present, &nearest, &spacing).into_iter().map(|place| kept[place]).collect();
                dropped.extend_from_slice(&found);
                found
            } else {
                let pairs = close_points(&present, &nearest, &spacing);
                twins.extend(pairs.iter().map(|pair| pair.map(|place| kept[place])));
                pairs.iter().map(|pair| kept[pair[1]]).collect()
            };
            if found.is_empty() {
                break;
            }
            remove(&mut kept, &found);
        }
    }
    let first = twins.iter().min_by_key(|pair| pair[1]).copied();
    let merged = PointList::from_indices(twins.iter().map(|pair| pair[1]).collect());
    let dropped = PointList::from_indices(dropped);
    if cleaning == Cleaning::Refuse {
        if let (Some(points_found), Some(pair)) = (merged, first) {
            let distance = (points[pair[0]] - points[pair[1]]).norm();
            return Err(Unusable::Duplicates { points: points_found, pair, distance });
        }
        if let Some(strays) = dropped {
            return Err(Unusable::Strays(strays));
        }
        return Ok(Cleaned { kept, merged: None, dropped: None, twins: Vec::new() });
    }
    Ok(Cleaned { kept, merged, dropped, twins })
}

impl Cleaned {
    /// For each of `count` given points its place among those that stay: that of the point that stands for it where it was
    /// merged, and none where it was dropped.
    #[must_use]
    pub fn places(&self, count: usize) -> Vec<Option<u32>> {
        let mut places = vec![None; count];
        self.kept.iter().enumerate().for_each(|(place, i)| places[*i] = Some(place as u32));
        let mut stands_for: Vec<usize> = (0..count).collect();
        self.twins.iter().for_each(|[stays, merged]| stands_for[*merged] = *stays);
        for [_, merged] in &self.twins {
            // The point that stands for it may have been merged later.
            let mut last = *merged;
            while stands_for[last] != last {
                last = stands_for[last];
            }
            places[*merged] = places[last];
        }
        places
    }
}

/// Removes indices from an ascending list.
fn remove(kept: &mut Vec<usize>, out: &[usize]) {
    let mut out = out.to_vec();
    out.sort_unstable();
    kept.retain(|i| out.binary_search(i).is_err());
}

/// Pairs of equal points: the one with the smallest index at the place, and another one.
fn equal_points<const D: usize>(points: &[Vector<D>]) -> Vec<[usize; 2]> {
    let compare = |a: &Vector<D>, b: &Vector<D>| {
        // −0 and 0 are one place.
        (0..D).filter_map(|d| a[d].partial_cmp(&b[d])).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
    };
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_unstable_by(|a, b| compare(&points[*a], &points[*b]).then(a.cmp(b)));
    let groups = order.chunk_by(|a, b| points[*a] == points[*b]);
    groups.flat_map(|group| group[1..].iter().map(|twin| [group[0], *twin])).collect()
}

/// Pairs of points that almost coincide, the one that stays first.
fn close_points<const D: usize>(points: &[Vector<D>], nearest: &Nearest, spacing: &[f64]) -> Vec<[usize; 2]> {
    let mut is_out = vec![false; points.len()];
    let mut pairs = Vec::new();
    for i in 0..points.len() {
        if is_out[i] {
            continue;
        }
        for j in nearest.of(i).iter().map(|j| *j as usize) {
            if (points[j] - points[i]).norm() > SAME_POINT * spacing[i] {
                break;
            }
            if j > i && !is_out[j] {
                is_out[j] = true;
                pairs.push([i, j]);
            }
        }
    }
    pairs
}

/// Points far from their third neighbor, and from points that are about as far from theirs: three of these nearby are a
/// sparse part of the cloud.
fn strays<const D: usize>(points: &[Vector<D>], nearest: &Nearest, spacing: &[f64]) -> Vec<usize> {
    let typical = median(&mut spacing.to_vec());
    let third = |i: usize| nearest.of(i).get(2).map(|j| *j as usize);
    let distance = |i: usize| third(i).map_or(0.0, |j| (points[j] - points[i]).norm());
    let is_far = |i: &usize| third(*i).is_some_and(|j| distance(*i) > FAR * typical.max(spacing[j]));
    let far: Vec<usize> = (0..points.len()).filter(is_far).collect();
    if far.is_empty() {
        return far;
    }
    let sparse: Vec<Vector<D>> =
        (0..points.len()).filter(|i| distance(*i) > 0.5 * FAR * typical).map(|i| points[i]).collect();
    let peers = KdTree::new(&sparse);
    let mut found = Vec::new();
    let mut is_alone = |i: &usize| {
        // The point itself is the nearest.
        peers.nearest(&points[*i], 4, &mut found);
        found.get(3).is_none_or(|(square, _)| square.sqrt() > SPARSE * distance(*i))
    };
    far.into_iter().filter(|i| is_alone(i)).collect()
}

#[cfg(test)]
mod tests {
    use super::{Cleaning, Unusable, Vector, clean};
    use crate::geometry::fibonacci;

    #[test]
    fn twins_and_strays_are_left_out_and_counted() {
        let mut points = fibonacci::sphere(1000);
        let spacing = 0.11;
        for i in 0..10 {
            // Ten equal twins, ten that are almost equal, a place with forty copies, and three strays, two of them close.
            points.push(points[17 * i]);
            points.push(points[31 * i + 5] + Vector::<3>::new(1e-5 * spacing, 0.0, 0.0));
        }
        points.extend(vec![points[500]; 40]);
        points.extend([
            Vector::<3>::new(9.0, 0.0, 0.0),
            Vector::<3>::new(9.0, 0.01, 0.0),
            -Vector::<3>::new(1e5, 0.0, 0.0),
        ]);
        let found = clean(&points, Cleaning::Drop).unwrap();
        assert_eq!(found.kept, (0..1000).collect::<Vec<_>>());
        assert_eq!(found.merged.map(|list| (list.count, list.first)), Some((60, vec![1000, 1001, 1002, 1003, 1004])));
        assert_eq!(found.dropped.map(|list| list.first), Some(vec![1060, 1061, 1062]));
        assert_eq!(clean(&points, Cleaning::Off).unwrap().kept.len(), 1063);
        assert!(matches!(clean(&points, Cleaning::Refuse), Err(Unusable::Duplicates { pair: [0, 1000], .. })));
        let strays = [&points[..1000], &points[1060..]].concat();
        assert!(matches!(clean(&strays, Cleaning::Refuse), Err(Unusable::Strays(list)) if list.count == 3));
    }

    #[test]
    fn a_dense_part_makes_no_strays_of_the_others() {
        // A hundred times as many points on the half with z > 0.
        let points: Vec<_> = fibonacci::sphere(40_000)
            .into_iter()
            .enumerate()
            .filter(|(i, x)| x[2] > 0.0 || i % 100 == 0)
            .map(|(_, x)| x)
            .collect();
        let found = clean(&points, Cleaning::Drop).unwrap();
        assert_eq!((found.merged, found.dropped), (None, None));
    }
}
