//! Choice of the particles that take part in a fit.
//!
//! The radius grows until there are enough neighbors. A fit breaks down when it has hardly more neighbors than
//! coefficients.

use crate::geometry::Vector;
use crate::neighbors::{Neighbor, NeighborSearch};

/// The rule by which particles take part in a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Neighborhood {
    /// All particles within a radius, which grows until there are enough.
    Radius {
        /// Cutoff radius r_c, a length.
        cutoff: f64,
    },
    /// The nearest particles, the particle itself included.
    Nearest {
        /// Number of particles.
        count: usize,
    },
}

/// Radius of a collected neighborhood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Cutoff radius after growth, or the distance of the farthest neighbor of a neighborhood by count.
    pub radius: f64,
    /// Number of times that the radius grew.
    pub enlargements: u32,
}

/// Factor by which one enlargement multiplies the radius.
pub const GROWTH: f64 = 1.06;
/// A neighborhood by count whose radius exceeds that of evenly spread particles by this factor is counted as enlarged:
/// particles are missing.
const SPARSE_RATIO: f64 = 1.5;
/// Largest number of enlargements, 1.06⁴⁰ ≈ 10.
const MAX_ENLARGEMENTS: u32 = 40;
/// Number of enlargements for which one search collects the particles in advance.
const GROWTH_STEPS_AHEAD: i32 = 3;

/// Radius, in multiples of the spacing, of a ball that contains `count` evenly distributed particles.
#[must_use]
pub fn radius_of_count<const D: usize>(count: f64) -> f64 {
    let ball = if D == 2 { std::f64::consts::PI } else { 4.0 / 3.0 * std::f64::consts::PI };
    (count / ball).powf(1.0 / D as f64)
}

/// Replaces `neighbors` by the particles within `radius` of `x` for which `admit` holds.
pub fn gather<const D: usize>(
    search: &impl NeighborSearch<D>,
    x: &Vector<D>,
    radius: f64,
    admit: &impl Fn(usize) -> bool,
    neighbors: &mut Vec<Neighbor<D>>,
) {
    search.gather(x, radius, neighbors);
    neighbors.retain(|neighbor| admit(neighbor.index));
}

impl Neighborhood {
    /// Replaces `neighbors` by the admitted particles around `x`.
    ///
    /// - `needed`: number of particles to collect, if there are as many within ten times the radius.
    /// - `spacing`: typical distance of particles, from which searches by count start.
    /// - `admit`: whether a particle may take part.
    pub fn collect<const D: usize>(
        self,
        search: &impl NeighborSearch<D>,
        x: &Vector<D>,
        needed: usize,
        spacing: f64,
        admit: &impl Fn(usize) -> bool,
        neighbors: &mut Vec<Neighbor<D>>,
    ) -> Extent {
        match self {
            Self::Radius { cutoff } => collect_within_radius(cutoff, search, x, needed, spacing, admit, neighbors),
            Self::Nearest { count } => {
                let extent = collect_nearest(count.max(needed), search, x, spacing, admit, neighbors);
                Extent { enlargements: extent.enlargements + u32::from(count < needed), ..extent }
            }
        }
    }
}

/// Collects all admitted particles within `cutoff`, or within a larger radius that contains `needed` of them.
fn collect_within_radius<const D: usize>(
    cutoff: f64,
    search: &impl NeighborSearch<D>,
    x: &Vector<D>,
    needed: usize,
    spacing: f64,
    admit: &impl Fn(usize) -> bool,
    neighbors: &mut Vec<Neighbor<D>>,
) -> Extent {
    let expected = spacing * radius_of_count::<D>(needed as f64);
    // Where growth is likely, one search serves its first steps.
    let mut seen =
        if cutoff < 1.2 * expected { cutoff.max(0.8 * expected) * GROWTH.powi(GROWTH_STEPS_AHEAD) } else { cutoff };
    gather(search, x, seen, admit, neighbors);
    let within = |neighbors: &[Neighbor<D>], radius: f64| {
        let limit = radius * radius;
        neighbors.iter().filter(|n| n.r2 <= limit).count()
    };
    let mut radius = cutoff;
    let mut enlargements = 0;
    let mut found = within(neighbors, radius);
    if found < needed {
        // A radius far below that of an even distribution grows at once, since small steps would be slow.
        enlargements += u32::from(radius < 0.8 * expected);
        radius = radius.max(0.8 * expected);
        found = within(neighbors, radius);
    }
    while found < needed && enlargements < MAX_ENLARGEMENTS {
        radius *= GROWTH;
        enlargements += 1;
        if radius > seen {
            seen = radius * GROWTH.powi(GROWTH_STEPS_AHEAD);
            gather(search, x, seen, admit, neighbors);
        }
        found = within(neighbors, radius);
    }
    if found < neighbors.len() {
        let limit = radius * radius;
        neighbors.retain(|n| n.r2 <= limit);
    }
    Extent { radius, enlargements }
}

/// Collects the `count` nearest admitted particles, or all of them if there are fewer.
fn collect_nearest<const D: usize>(
    count: usize,
    search: &impl NeighborSearch<D>,
    x: &Vector<D>,
    spacing: f64,
    admit: &impl Fn(usize) -> bool,
    neighbors: &mut Vec<Neighbor<D>>,
) -> Extent {
    // The volume has a quarter in reserve over an even distribution, so that one search usually suffices.
    let expected = spacing * radius_of_count::<D>(count as f64);
    let mut radius = 1.12 * expected;
    let mut tries = 0;
    gather(search, x, radius, admit, neighbors);
    while neighbors.len() < count && tries < MAX_ENLARGEMENTS {
        radius *= 1.3;
        tries += 1;
        gather(search, x, radius, admit, neighbors);
    }
    // The index decides between equal distances, so that the choice depends on the particles alone.
    if neighbors.len() > count {
        neighbors.select_nth_unstable_by(count - 1, |a, b| a.r2.total_cmp(&b.r2).then(a.index.cmp(&b.index)));
        neighbors.truncate(count);
        neighbors.sort_unstable_by_key(|n| n.index);
    }
    let farthest = neighbors.iter().map(|n| n.r2).fold(0.0, f64::max).sqrt();
    // A neighborhood far wider than an even one shows that particles are missing.
    Extent { radius: farthest.max(spacing * 1e-3), enlargements: u32::from(farthest > SPARSE_RATIO * expected) }
}
