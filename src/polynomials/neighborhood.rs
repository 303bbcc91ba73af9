//! Who takes part in a fit. A count drives the radius: what breaks a fit is a number of neighbors close to the number
//! of coefficients.

use crate::geometry::Vector;
use crate::neighbors::{Neighbor, NeighborSearch};

/// Which particles take part in a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Neighborhood {
    /// All within a radius, which grows until there are enough.
    Radius {
        /// r_c in absolute length.
        cutoff: f64,
    },
    /// The nearest ones, the particle itself included.
    Nearest {
        /// How many.
        count: usize,
    },
}

/// The extent of a collected neighborhood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// r_c after growth, or the distance of the farthest of the nearest.
    pub radius: f64,
    /// How often the radius grew.
    pub enlargements: u32,
}

/// Factor of one enlargement.
pub const GROWTH: f64 = 1.06;
/// The nearest particles reach so much farther than evenly spread ones where many are missing.
const SPARSE_RATIO: f64 = 1.5;
/// Most enlargements: 1.06⁴⁰ ≈ 10.
const MAX_ENLARGEMENTS: u32 = 40;
/// Enlargements that one search looks ahead.
const GROWTH_STEPS_AHEAD: i32 = 3;

/// Radius, in spacings, of a ball that holds so many evenly distributed particles.
#[must_use]
pub fn radius_of_count<const D: usize>(count: f64) -> f64 {
    let ball = if D == 2 { std::f64::consts::PI } else { 4.0 / 3.0 * std::f64::consts::PI };
    (count / ball).powf(1.0 / D as f64)
}

/// All admitted particles within a radius.
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
    /// Fills `neighbors` with the admitted particles about `x`, at least `needed` if there are so many within ten times
    /// the radius. `spacing` is a length of the order of the particles' distances, where searches by count begin.
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
    // One search serves the first steps of growth where growth is likely.
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
        // Far below what an even distribution needs, small steps would only be slow.
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

fn collect_nearest<const D: usize>(
    count: usize,
    search: &impl NeighborSearch<D>,
    x: &Vector<D>,
    spacing: f64,
    admit: &impl Fn(usize) -> bool,
    neighbors: &mut Vec<Neighbor<D>>,
) -> Extent {
    // A quarter more than an even distribution needs: one search mostly does.
    let expected = spacing * radius_of_count::<D>(count as f64);
    let mut radius = 1.12 * expected;
    let mut tries = 0;
    gather(search, x, radius, admit, neighbors);
    while neighbors.len() < count && tries < MAX_ENLARGEMENTS {
        radius *= 1.3;
        tries += 1;
        gather(search, x, radius, admit, neighbors);
    }
    // Ties are settled by the index, so the choice depends on the particles alone.
    if neighbors.len() > count {
        neighbors.select_nth_unstable_by(count - 1, |a, b| a.r2.total_cmp(&b.r2).then(a.index.cmp(&b.index)));
        neighbors.truncate(count);
        neighbors.sort_unstable_by_key(|n| n.index);
    }
    let farthest = neighbors.iter().map(|n| n.r2).fold(0.0, f64::max).sqrt();
    // A neighborhood far wider than an even one says that particles are missing.
    Extent { radius: farthest.max(spacing * 1e-3), enlargements: u32::from(farthest > SPARSE_RATIO * expected) }
}
