//! The remeshing kernel Λ₄,₄ (PCP appendix A), a product of one-dimensional piecewise polynomials of degree 9.
//!
//! It is four times continuously differentiable and keeps the moments 0 to 4.

use super::SmoothingKernel;
use crate::geometry::Vector;

/// The kernel ∏_d Λ(|dx_d|/h)/h for particles and nodes of spacing h.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lambda44 {
    /// Spacing h of the particles and of the nodes.
    pub spacing: f64,
}

/// Coefficients of the three pieces in ascending powers of q.
///
/// The cubic term of the second piece is 28425/4 (docs/errata.md, PCP A). With the printed 28425/8 the kernel is not
/// continuous.
const PIECES: [[f64; 10]; 3] = [
    [1.0, 0.0, -5.0 / 4.0, 0.0, 1.0 / 4.0, -100.0 / 3.0, 455.0 / 4.0, -295.0 / 2.0, 345.0 / 4.0, -115.0 / 6.0],
    [
        -199.0,
        5485.0 / 4.0,
        -32975.0 / 8.0,
        28425.0 / 4.0,
        -61953.0 / 8.0,
        33175.0 / 6.0,
        -20685.0 / 8.0,
        3055.0 / 4.0,
        -1035.0 / 8.0,
        115.0 / 12.0,
    ],
    [
        5913.0,
        -89235.0 / 4.0,
        297_585.0 / 8.0,
        -143_895.0 / 4.0,
        177_871.0 / 8.0,
        -54641.0 / 6.0,
        19775.0 / 8.0,
        -1715.0 / 4.0,
        345.0 / 8.0,
        -23.0 / 12.0,
    ],
];

/// The function Λ₄,₄(q) for q ≥ 0.
fn piecewise(q: f64) -> f64 {
    let Some(piece) = PIECES.get(q as usize) else { return 0.0 };
    piece.iter().rev().fold(0.0, |sum, c| sum * q + c)
}

impl<const D: usize> SmoothingKernel<D> for Lambda44 {
    fn value(&self, dx: &Vector<D>) -> f64 {
        dx.iter().map(|d| piecewise(d.abs() / self.spacing) / self.spacing).product()
    }

    fn support(&self) -> f64 {
        3.0 * self.spacing * (D as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::piecewise;

    #[test]
    fn moments_up_to_the_fourth_are_kept_on_a_grid() {
        for shift in [0.0, 0.2, 0.5, 0.77] {
            for power in 0..=4 {
                let moment: f64 =
                    (-4..=4).map(|k| f64::from(k) + shift).map(|x| x.powi(power) * piecewise(x.abs())).sum();
                let expected = if power == 0 { 1.0 } else { 0.0 };
                // Coefficients up to 3e5 cost five digits, and the fourth powers of 4 some more.
                assert!((moment - expected).abs() < 1e-7, "moment {power} at {shift}: {moment}");
            }
        }
    }

    #[test]
    fn pieces_join_smoothly() {
        for joint in [1.0_f64, 2.0, 3.0] {
            let gap = piecewise(joint.next_down()) - piecewise(joint);
            assert!(gap.abs() < 1e-9, "{gap} at {joint}");
            let slope = |a: f64, b: f64| (piecewise(b) - piecewise(a)) / (b - a);
            assert!((slope(joint - 1e-5, joint - 1e-9) - slope(joint, joint + 1e-5)).abs() < 1e-3);
        }
    }
}
