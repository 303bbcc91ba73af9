//! Unions of separate shapes.

use super::{Surface, SurfacePoint, Vector};

/// The union of shapes that do not overlap. Each distance, also inside, is then the smallest of the parts' distances.
pub struct Union<const D: usize> {
    parts: Vec<Box<dyn Surface<D>>>,
}

/// Two parts of a union overlap, so that distances inside it are not those of its parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("parts {first} and {second} overlap; a union takes separate shapes")]
pub struct Overlap {
    /// Index of the first part.
    pub first: usize,
    /// Index of the second part.
    pub second: usize,
}

impl<const D: usize> Union<D> {
    /// The union of at least one part.
    ///
    /// # Errors
    /// [`Overlap`] when two parts contain the same point of a lattice of 48 points per side over their common bounding
    /// box. Thinner overlaps are not detected.
    pub fn new(parts: Vec<Box<dyn Surface<D>>>) -> Result<Self, Overlap> {
        for second in 1..parts.len() {
            for first in 0..second {
                if overlap(parts[first].as_ref(), parts[second].as_ref()) {
                    return Err(Overlap { first, second });
                }
            }
        }
        Ok(Self { parts })
    }
}

/// Whether a lattice point of the common bounding box lies in both shapes.
fn overlap<const D: usize>(a: &dyn Surface<D>, b: &dyn Surface<D>) -> bool {
    const SIDE: usize = 48;
    let (a_box, b_box) = (a.bounding_box(), b.bounding_box());
    let low = a_box.0.sup(&b_box.0);
    let high = a_box.1.inf(&b_box.1);
    if (0..D).any(|d| low[d] >= high[d]) {
        return false;
    }
    (0..SIDE.pow(D as u32)).any(|k| {
        let x = Vector::<D>::from_fn(|d, _| {
            let index = k / SIDE.pow(d as u32) % SIDE;
            low[d] + (high[d] - low[d]) * (index as f64 + 0.5) / SIDE as f64
        });
        a.signed_distance(&x) < 0.0 && b.signed_distance(&x) < 0.0
    })
}

impl<const D: usize> Surface<D> for Union<D> {
    fn nearest(&self, x: &Vector<D>) -> SurfacePoint<D> {
        let mut best = self.parts[0].nearest(x);
        for part in &self.parts[1..] {
            let answer = part.nearest(x);
            if answer.distance < best.distance {
                best = answer;
            }
        }
        best
    }

    fn bounding_box(&self) -> (Vector<D>, Vector<D>) {
        let mut total = self.parts[0].bounding_box();
        for part in &self.parts[1..] {
            let (low, high) = part.bounding_box();
            total = (total.0.inf(&low), total.1.sup(&high));
        }
        total
    }

    fn area_or_volume(&self) -> f64 {
        self.parts.iter().map(|part| part.area_or_volume()).sum()
    }

    fn near_medial_axis(&self, x: &Vector<D>, tolerance: f64) -> bool {
        let mut distances: Vec<f64> = self.parts.iter().map(|part| part.signed_distance(x)).collect();
        distances.sort_by(f64::total_cmp);
        let between = distances.len() > 1 && distances[1] - distances[0] <= tolerance;
        between || self.parts.iter().any(|part| part.near_medial_axis(x, tolerance))
    }

    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<D>>> {
        self.parts.iter().flat_map(|part| part.outline(spacing)).collect()
    }
}
