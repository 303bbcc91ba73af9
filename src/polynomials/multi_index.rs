//! Multi-indices α with |α| = Σ α_i ≤ n, graded by |α|.
//!
//! Terms of lower degree come first, so that a basis of lower degree is the beginning of one of higher degree.

/// All multi-indices with `D` entries up to a total degree.
///
/// ```
/// use meniscus::polynomials::MultiIndexSet;
///
/// let set = MultiIndexSet::<2>::total_degree(1);
/// assert_eq!(set.indices(), [[0, 0], [1, 0], [0, 1]]);
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MultiIndexSet<const D: usize> {
    indices: Vec<[u8; D]>,
}

impl<const D: usize> MultiIndexSet<D> {
    /// The set of total degree `degree`, which has C(degree + D, D) indices.
    #[must_use]
    pub fn total_degree(degree: usize) -> Self {
        let mut indices = Vec::new();
        for grade in 0..=degree {
            let mut index = [0_u8; D];
            push_grade(&mut indices, &mut index, 0, grade);
        }
        Self { indices }
    }

    /// The indices in graded order.
    #[must_use]
    pub fn indices(&self) -> &[[u8; D]] {
        &self.indices
    }
}

/// Appends all indices whose entries from `axis` on sum to `rest`, the first of these entries descending.
fn push_grade<const D: usize>(indices: &mut Vec<[u8; D]>, index: &mut [u8; D], axis: usize, rest: usize) {
    if axis == D - 1 {
        index[axis] = rest as u8;
        indices.push(*index);
        return;
    }
    for exponent in (0..=rest).rev() {
        index[axis] = exponent as u8;
        push_grade(indices, index, axis + 1, rest - exponent);
    }
}

/// Number of terms C(degree + D, D) of a polynomial of total degree `degree` in `D` variables.
#[must_use]
pub fn term_count<const D: usize>(degree: usize) -> usize {
    (1..=D).fold(1, |product, k| product * (degree + k) / k)
}

#[cfg(test)]
mod tests {
    use super::{MultiIndexSet, term_count};

    #[test]
    fn graded_sets_are_complete_and_nested() {
        for degree in 0..=8 {
            let set = MultiIndexSet::<3>::total_degree(degree);
            assert_eq!(set.indices().len(), term_count::<3>(degree));
            let larger = MultiIndexSet::<3>::total_degree(degree + 1);
            assert_eq!(set.indices(), &larger.indices()[..set.indices().len()]);
            let mut unique = set.indices().to_vec();
            unique.sort_unstable();
            unique.dedup();
            assert_eq!(unique.len(), set.indices().len());
        }
        assert_eq!((term_count::<2>(4), term_count::<3>(4), term_count::<3>(8)), (15, 35, 165));
    }
}
