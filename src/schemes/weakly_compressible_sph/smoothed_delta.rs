//! The smoothed δ and step of the interface.

/// The smoothed δ of a signed distance: Wendland's C² kernel of one dimension (B.3), with the support 2 ε.
pub fn smoothed_delta(distance: f64, smoothing_length: f64) -> f64 {
    let q = distance.abs() / smoothing_length;
    let rest = (1.0 - 0.5 * q).max(0.0);
    0.625 / smoothing_length * rest * rest * rest * (1.5 * q + 1.0)
}

/// The integral of [`smoothed_delta`] up to a signed distance, from 0 to 1.
pub fn smoothed_step(distance: f64, smoothing_length: f64) -> f64 {
    // ∫ (5/4) (1 − t)³ (1 + 3t) dt with t = |d|/(2ε).
    let t = (0.5 * distance.abs() / smoothing_length).min(1.0);
    let half = 1.25 * (t - 2.0 * t.powi(3) + 2.0 * t.powi(4) - 0.6 * t.powi(5));
    0.5 + half.copysign(distance)
}

#[cfg(test)]
mod tests {
    use super::{smoothed_delta, smoothed_step};

    #[test]
    fn the_smoothed_step_is_the_integral_of_delta() {
        for d in [-0.9, -0.5, -0.1, 0.0, 0.2, 0.7, 0.79] {
            let slope = (smoothed_step(d + 1e-5, 0.4) - smoothed_step(d - 1e-5, 0.4)) / 2e-5;
            assert!((slope - smoothed_delta(d, 0.4)).abs() < 1e-4, "{d}");
        }
        assert!((smoothed_step(2.0, 0.4) - 1.0).abs() < 1e-15 && smoothed_step(-2.0, 0.4).abs() < 1e-15);
    }

    #[test]
    fn the_smoothed_delta_integrates_to_one() {
        let sum: f64 = (0..4000).map(|k| smoothed_delta(f64::from(k - 2000) * 1e-3 + 5e-4, 0.4) * 1e-3).sum();
        assert!((sum - 1.0).abs() < 1e-6, "{sum}");
    }
}
