//! Random numbers by counter: a value depends on the seed and its counters alone.
//!
//! Neither the order of evaluation nor the number of threads can therefore change a scene. The mixing function is the
//! finalizer of SplitMix64 (key "SplitMix64" of the bibliography).

/// A keyed source of uniform random numbers without state.
///
/// ```
/// use meniscus::geometry::random::CounterRandom;
///
/// let random = CounterRandom::new(7);
/// assert_eq!(random.symmetric(&[3, 0]), CounterRandom::new(7).symmetric(&[3, 0]));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CounterRandom {
    key: u64,
}

impl CounterRandom {
    /// The source for a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { key: mix(seed ^ 0x6d65_6e69_7363_7573) }
    }

    /// A number, uniform in `[−1, 1)`, for a list of counters, such as the indices of a lattice node and an axis.
    #[must_use]
    pub fn symmetric(&self, counters: &[i64]) -> f64 {
        let mut state = self.key;
        for &counter in counters {
            state = mix(state ^ counter.cast_unsigned().wrapping_mul(0x9e37_79b9_7f4a_7c15));
        }
        // 53 random bits give a number in [0, 1).
        #[expect(clippy::cast_precision_loss, reason = "53 bits fit a double")]
        let unit = (state >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0);
        2.0 * unit - 1.0
    }
}

/// The finalizer of SplitMix64, a bijection of 64-bit integers.
fn mix(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::CounterRandom;

    #[test]
    fn moments_are_those_of_the_uniform_distribution() {
        let random = CounterRandom::new(1);
        let n = 200_000_i64;
        let (mut mean, mut square, mut lag) = (0.0, 0.0, 0.0);
        for i in 0..n {
            let x = random.symmetric(&[i, 0]);
            assert!((-1.0..1.0).contains(&x));
            mean += x;
            square += x * x;
            lag += x * random.symmetric(&[i + 1, 0]);
        }
        let n = n as f64;
        // Five standard deviations of each estimate.
        assert!((mean / n).abs() < 5.0 * (1.0 / 3.0 / n).sqrt());
        assert!((square / n - 1.0 / 3.0).abs() < 5.0 * (4.0 / 45.0 / n).sqrt());
        assert!((lag / n).abs() < 5.0 / 3.0 / n.sqrt());
    }

    #[test]
    fn seeds_and_counters_decorrelate() {
        assert_ne!(
            CounterRandom::new(1).symmetric(&[3, 4]).to_bits(),
            CounterRandom::new(2).symmetric(&[3, 4]).to_bits()
        );
        assert_ne!(
            CounterRandom::new(1).symmetric(&[3, 4]).to_bits(),
            CounterRandom::new(1).symmetric(&[4, 3]).to_bits()
        );
    }
}
