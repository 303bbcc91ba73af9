//! The embedded Runge–Kutta pair of order 5(4) of Dormand 1980 for large systems du/dt = f(u, t), in fixed or
//! controlled steps.

use super::integrators::dopri5::{A, C, E};
use rayon::prelude::{IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator};

/// Slopes and stages of a system.
///
/// Only the last slope outlives a step: the slope at the end of a step is the first slope of the next one.
///
/// ```
/// use meniscus::time::embedded_pair::EmbeddedPair;
///
/// // du/dt = −u over one step of 0.1.
/// let mut slope = |u: &[f64], _t: f64, out: &mut [f64]| out[0] = -u[0];
/// let (mut pair, mut u) = (EmbeddedPair::default(), vec![1.0]);
/// let error = pair.try_step(&u, 0.0, 0.1, &mut slope);
/// pair.accept(&mut u);
/// assert!(error < 1e-6 && (u[0] - (-0.1_f64).exp()).abs() < 1e-9);
/// ```
#[derive(Debug, Default)]
pub struct EmbeddedPair {
    slopes: [Vec<f64>; 7],
    stage: Vec<f64>,
    is_slope_known: bool,
}

/// Right-hand side f(u, t), which writes the slope to its third argument.
pub type Slope<'a> = dyn FnMut(&[f64], f64, &mut [f64]) + 'a;

/// Smallest number of entries of a parallel task.
const ENTRIES: usize = 4096;

impl EmbeddedPair {
    /// Discards the last slope, after the state was changed from outside.
    pub fn discard_slope(&mut self) {
        self.is_slope_known = false;
    }

    /// Tries a step from `time` to `end`, whose result is then [`Self::result`].
    ///
    /// Returns the error estimate: the root mean square of the difference of both orders, divided by 1 + |u|.
    pub fn try_step(&mut self, u: &[f64], time: f64, end: f64, slope: &mut Slope<'_>) -> f64 {
        let Self { slopes, stage, is_slope_known } = self;
        slopes.iter_mut().for_each(|slope| slope.resize(u.len(), 0.0));
        stage.resize(u.len(), 0.0);
        if !*is_slope_known {
            slope(u, time, &mut slopes[0]);
            *is_slope_known = true;
        }
        let step = end - time;
        for s in 0..6 {
            let (known, next) = slopes.split_at_mut(s + 1);
            let weights = &A[s][..=s];
            stage.par_iter_mut().with_min_len(ENTRIES).enumerate().for_each(|(i, stage)| {
                let sum: f64 = weights.iter().zip(known.iter()).map(|(a, k)| a * k[i]).sum();
                *stage = u[i] + step * sum;
            });
            // The last two stages are at `end`, to the last bit.
            let now = if s >= 4 { end } else { time + C[s] * step };
            slope(stage, now, &mut next[0]);
        }
        let mut sum = 0.0;
        for (i, value) in stage.iter().enumerate() {
            let difference: f64 = E.iter().zip(slopes.iter()).map(|(e, k)| e * k[i]).sum();
            sum += (step * difference / (1.0 + value.abs())).powi(2);
        }
        (sum / u.len().max(1) as f64).sqrt()
    }

    /// State at the end of the last tried step.
    #[must_use]
    pub fn result(&self) -> &[f64] {
        &self.stage
    }

    /// Copies the result of the last tried step to the state `u`.
    pub fn accept(&mut self, u: &mut [f64]) {
        u.copy_from_slice(&self.stage);
        self.slopes.swap(0, 6);
    }

    /// Slope du/dt at the present state, after at least one accepted step.
    #[must_use]
    pub fn slope(&self) -> &[f64] {
        &self.slopes[0]
    }
}

#[cfg(test)]
mod tests {
    use super::EmbeddedPair;

    #[test]
    fn the_order_is_five_and_the_estimate_follows_the_error() {
        // u' = cos t · u: u = exp(sin t).
        let mut slope = |u: &[f64], t: f64, out: &mut [f64]| out[0] = t.cos() * u[0];
        let mut error = |steps: u32| {
            let (mut pair, mut u, mut estimate) = (EmbeddedPair::default(), vec![1.0], 0.0_f64);
            let h = 2.0 / f64::from(steps);
            for n in 0..steps {
                estimate = estimate.max(pair.try_step(&u, f64::from(n) * h, f64::from(n + 1) * h, &mut slope));
                pair.accept(&mut u);
            }
            ((u[0] - 2.0_f64.sin().exp()).abs(), estimate)
        };
        let (coarse, fine) = (error(10), error(40));
        let order = 0.5 * (coarse.0 / fine.0).log2();
        assert!((order - 5.0).abs() < 0.4, "{order}");
        assert!(coarse.1 > 0.1 * coarse.0 && fine.1 < coarse.1);
    }
}
