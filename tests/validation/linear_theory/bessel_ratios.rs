//! Ratios of modified Bessel functions of complex argument, from continued fractions: nothing overflows.

use nalgebra::Complex;

/// z I_ν(z)/I_{ν+1}(z) for Re z ≥ 0 and |z| from 0 to 1e5 and more.
///
/// With `P_ν` for the ratio, `P_ν = 2(ν+1) + z²/P_{ν+1}` (DLMF 10.29.1, <https://dlmf.nist.gov/10.29>) is evaluated
/// backward from an order N terms higher, where `P = ν + 1 + √((ν+1)² + z²)` up to a term of order 1.
pub fn ratio_i(order: f64, z: Complex<f64>) -> Complex<f64> {
    let z2 = z * z;
    // N terms shrink the error of the start like exp(−N² Re(1/z)) while N < |z|, and at once where N > |z|.
    let terms = (40.0 * z.norm_sqr() / z.re).sqrt().min(1.2 * z.norm()) as usize + 60;
    let last = order + terms as f64 + 1.0;
    let start = (z2 + last * last).sqrt() + last;
    (0..terms).rev().fold(start, |ratio, k| z2 / ratio + 2.0 * (order + k as f64 + 1.0))
}

/// z K_ν(z)/K_{ν−1}(z) for Re z ≥ 0, |z| ≥ 0.01, and an order ν ≥ 1/2 that is an integer or half an odd integer.
///
/// With `P_ν` for the ratio, `P_{ν+1} = 2ν + z²/P_ν` (DLMF 10.29.1) is stable upward. It starts with `P_{1/2} = z` or
/// with `P_1` from the continued fraction of K₁/K₀ (Temme 1975).
pub fn ratio_k(order: f64, z: Complex<f64>) -> Complex<f64> {
    let (first, start) = if order.fract() > 0.25 { (0.5, z) } else { (1.0, ratio_k1(z)) };
    let steps = (order - first).round() as usize;
    (0..steps).fold(start, |ratio, k| z * z / ratio + 2.0 * (first + k as f64))
}

/// z K₁(z)/K₀(z) = z + 1/2 − (1/4)/(b₁ + a₂/(b₂ + a₃/(b₃ + …))), b_n = 2(n + z), a_n = −(n − 1/2)².
fn ratio_k1(z: Complex<f64>) -> Complex<f64> {
    // The error falls like exp(−√(8 N |z|) cos(arg(z)/2)): 1e-20 for these N terms at arg(z) = π/2.
    let terms = 40 + (600.0 / z.norm()).min(1e5) as usize;
    // The rest t of the fraction behind the last term, from t = −n²/(2(n + z) + t).
    let n = terms as f64 + 0.5;
    let rest = z.sqrt() * (z + 2.0 * n).sqrt() - (z + n);
    let tail = (2..=terms).rev().fold(rest, |tail, n| {
        let n = n as f64;
        -(n - 0.5).powi(2) / ((z + n) * 2.0 + tail)
    });
    z + 0.5 - 0.25 / ((z + 1.0) * 2.0 + tail)
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn c(re: f64, im: f64) -> Complex<f64> {
        Complex::new(re, im)
    }

    type Row = (f64, f64, f64, Complex<f64>, Complex<f64>);

    /// Order, |z|, arg z, both ratios: besseli and besselk of mpmath 1.3 with 40 digits.
    const REFERENCES: [Row; 9] = [
        (1.0, 0.1, 0.8, c(3.9999516807697137, 0.0016659761585672444), c(0.3737385601439197, 0.11613180793257269)),
        (1.0, 10000.0, 0.8, c(6968.567224103614, 7173.560774472218), c(6967.567084762784, 7173.560917960929)),
        (2.0, 1.0, 1.5, c(5.874720360887839, 0.018090420666690785), c(1.7414325494784682, 0.801986114480156)),
        (2.0, 100.0, 1.2, c(38.75130865921661, 93.16283478833886), c(37.73716149957433, 93.20043898947311)),
        (5.0, 3000.0, 1.5, c(217.71202451373125, 2992.4790161194396), c(216.7117915546576, 2992.482341510609)),
        (1.5, 0.1, 0.8, c(4.9999585127725465, 0.0014279754681524243), c(1.0696706709347166, 0.07173560908995227)),
        (2.5, 1.0, 1.5, c(6.88890540490616, 0.016001707572144575), c(2.570737201667703, 0.5316967566320182)),
        (2.5, 10000.0, 0.8, c(6970.067511493935, 7173.560478521605), c(6969.067163142617, 7173.560837269613)),
        (5.5, 10.0, 0.8, c(14.631120369523256, 5.626547750550379), c(12.676688177728401, 6.578726089918032)),
    ];

    #[test]
    fn ratios_agree_with_a_library_of_many_digits() {
        for (order, modulus, angle, i, k) in REFERENCES {
            let z = Complex::from_polar(modulus, angle);
            // Each step of a fraction rounds by about 1e-16; the ratio forgets all but the last steps.
            for (ratio, reference) in [(ratio_i(order, z), i), (ratio_k(order, z), k)] {
                let error = (ratio - reference).norm() / reference.norm();
                assert!(error < 2e-14, "order {order}, z {z}: {ratio}, not {reference}");
            }
        }
    }
}
