//! Blocks of cells or nodes that are counted one by one.

/// The indices along the axes of member `k` of a block with these numbers of members; the first axis runs fastest.
#[must_use]
pub fn indices<const D: usize>(k: usize, counts: &[usize; D]) -> [usize; D] {
    let mut rest = k;
    std::array::from_fn(|d| {
        let index = rest % counts[d];
        rest /= counts[d];
        index
    })
}

#[cfg(test)]
mod tests {
    use super::indices;

    #[test]
    fn every_member_has_indices_of_its_own_in_order() {
        let all: Vec<[usize; 3]> = (0..24).map(|k| indices(k, &[2, 3, 4])).collect();
        assert_eq!((all[0], all[1], all[2], all[23]), ([0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 2, 3]));
        assert!((0..24).all(|k| all[k][0] + 2 * (all[k][1] + 3 * all[k][2]) == k));
    }
}
