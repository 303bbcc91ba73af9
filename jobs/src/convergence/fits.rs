//! Weighted least squares: a line, and a power law with an unknown limit.
//!
//! The weights are 1/h (Eça 2014, eq. 9): fine levels count more than coarse ones, where the leading term does not lead yet.

use nalgebra::{DMatrix, DVector};

/// Quantiles of Student's t for 95 % to both sides, for 1, 2, … degrees of freedom.
const STUDENT_95: [f64; 10] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228];

/// Half the width of the 95 % interval of a fitted number, in its standard errors.
#[must_use]
pub fn student_95(degrees_of_freedom: usize) -> f64 {
    let found = STUDENT_95.get(degrees_of_freedom.saturating_sub(1)).copied();
    // Beyond the table, within 0.5 %.
    found.unwrap_or(1.96 + 2.5 / degrees_of_freedom as f64)
}

/// A number with its standard error, where more points than unknowns were there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fitted {
    /// The number.
    pub value: f64,
    /// Its standard error.
    pub deviation: Option<f64>,
    /// Points beyond the unknowns.
    pub degrees_of_freedom: usize,
}

/// The slope of the line through points (x, y) with weights; None for fewer than two places x.
#[must_use]
pub fn slope(points: &[(f64, f64, f64)]) -> Option<Fitted> {
    let total: f64 = points.iter().map(|(_, _, w)| w).sum();
    let mean = |pick: fn(&(f64, f64, f64)) -> f64| points.iter().map(|p| p.2 * pick(p)).sum::<f64>() / total;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let spread: f64 = points.iter().map(|p| p.2 * (p.0 - x).powi(2)).sum();
    if spread.is_nan() || spread <= 1e-12 * total {
        return None;
    }
    let value = points.iter().map(|p| p.2 * (p.0 - x) * (p.1 - y)).sum::<f64>() / spread;
    let degrees_of_freedom = points.len().saturating_sub(2);
    let squares: f64 = points.iter().map(|p| p.2 * (p.1 - y - value * (p.0 - x)).powi(2)).sum();
    let deviation = (degrees_of_freedom > 0).then(|| (squares / degrees_of_freedom as f64 / spread).sqrt());
    Some(Fitted { value, deviation, degrees_of_freedom })
}

/// The parabola, or the line, that is nearest to points by least squares; beyond the outermost points it goes on straight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parabola {
    /// Mean place of the points.
    middle: f64,
    /// Value, slope and half the second derivative there.
    coefficients: [f64; 3],
    /// The outermost places.
    ends: (f64, f64),
}

impl Parabola {
    /// Through points (x, y) with two unknowns, a line, or three; None for fewer places.
    #[must_use]
    pub fn through(points: &[(f64, f64)], unknowns: usize) -> Option<Self> {
        let unknowns = unknowns.min(3);
        if points.len() < unknowns.max(1) {
            return None;
        }
        let middle = points.iter().map(|(x, _)| x).sum::<f64>() / points.len() as f64;
        let matrix = DMatrix::from_fn(points.len(), unknowns, |k, power| (points[k].0 - middle).powi(power as i32));
        let values = DVector::from_iterator(points.len(), points.iter().map(|(_, y)| *y));
        let decomposed = matrix.svd(true, true);
        if decomposed.rank(1e-9 * decomposed.singular_values.max()) < unknowns {
            return None;
        }
        let found = decomposed.solve(&values, 0.0).ok()?;
        let mut coefficients = [0.0; 3];
        coefficients[..found.len()].copy_from_slice(found.as_slice());
        let end = |pick: fn(f64, f64) -> f64, from: f64| points.iter().fold(from, |end, (x, _)| pick(end, *x));
        let ends = (end(f64::min, f64::INFINITY), end(f64::max, f64::NEG_INFINITY));
        Some(Self { middle, coefficients, ends })
    }

    /// The value at a place.
    #[must_use]
    pub fn at(&self, x: f64) -> f64 {
        let inside = x.clamp(self.ends.0, self.ends.1);
        let [value, slope, bend] = self.coefficients;
        let from_middle = inside - self.middle;
        value + (slope + bend * from_middle) * from_middle + self.slope(x) * (x - inside)
    }

    /// The slope at a place.
    #[must_use]
    pub fn slope(&self, x: f64) -> f64 {
        let [_, slope, bend] = self.coefficients;
        slope + 2.0 * bend * (x.clamp(self.ends.0, self.ends.1) - self.middle)
    }
}

/// Orders between which a power law is looked for.
pub const ORDERS: (f64, f64) = (0.05, 16.0);
/// Orders at which the sum of squares is looked at before the best one is refined.
const SCAN: usize = 320;

/// The order p of φ = φ₀ + C hᵖ through points (h, φ) by weighted least squares; None for fewer than four points.
#[must_use]
pub fn power_law(points: &[(f64, f64)]) -> Option<Fitted> {
    if points.len() < 4 {
        return None;
    }
    let finest = points.iter().map(|(h, _)| *h).fold(f64::INFINITY, f64::min);
    // Spacings by the finest one: powers stay near one.
    let scaled: Vec<(f64, f64, f64)> = points.iter().map(|(h, value)| (h / finest, *value, finest / h)).collect();
    let at = |k: usize| ORDERS.0 + (ORDERS.1 - ORDERS.0) * k as f64 / SCAN as f64;
    let squares = |p: f64| linear_part(&scaled, p).map_or(f64::INFINITY, |part| part.squares);
    let best = (0..=SCAN).min_by(|a, b| squares(at(*a)).total_cmp(&squares(at(*b))))?;
    let value = minimum(squares, at(best.saturating_sub(1)), at((best + 1).min(SCAN)));
    let part = linear_part(&scaled, value)?;
    let degrees_of_freedom = points.len() - 3;
    let variance = part.squares / degrees_of_freedom as f64;
    let deviation = inverse_of_order(&scaled, value, part.factor).map(|inverse| (variance * inverse).sqrt());
    Some(Fitted { value, deviation: deviation.filter(|d| d.is_finite()), degrees_of_freedom })
}

/// The factor C of the best φ₀ + C hᵖ for one p, and the weighted sum of squares that it leaves.
struct LinearPart {
    factor: f64,
    squares: f64,
}

fn linear_part(points: &[(f64, f64, f64)], p: f64) -> Option<LinearPart> {
    let powers: Vec<(f64, f64, f64)> = points.iter().map(|(h, value, w)| (h.powf(p), *value, *w)).collect();
    let total: f64 = powers.iter().map(|p| p.2).sum();
    let mean = |pick: fn(&(f64, f64, f64)) -> f64| powers.iter().map(|p| p.2 * pick(p)).sum::<f64>() / total;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let spread: f64 = powers.iter().map(|p| p.2 * (p.0 - x).powi(2)).sum();
    if spread.is_nan() || spread <= 0.0 {
        return None;
    }
    let factor = powers.iter().map(|p| p.2 * (p.0 - x) * (p.1 - y)).sum::<f64>() / spread;
    let squares = powers.iter().map(|p| p.2 * (p.1 - y - factor * (p.0 - x)).powi(2)).sum();
    Some(LinearPart { factor, squares })
}

/// The diagonal entry of (Jᵀ W J)⁻¹ that belongs to p, with the columns 1, hᵖ and C hᵖ ln h of J.
fn inverse_of_order(points: &[(f64, f64, f64)], p: f64, factor: f64) -> Option<f64> {
    let mut normal = [[0.0; 3]; 3];
    for (h, _, w) in points {
        let row = [1.0, h.powf(p), factor * h.powf(p) * h.ln()];
        for (i, a) in row.iter().enumerate() {
            for (j, b) in row.iter().enumerate() {
                normal[i][j] += w * a * b;
            }
        }
    }
    let minor = |a: usize, b: usize| normal[a][a] * normal[b][b] - normal[a][b] * normal[b][a];
    let determinant = normal[0][0] * minor(1, 2)
        - normal[0][1] * (normal[1][0] * normal[2][2] - normal[1][2] * normal[2][0])
        + normal[0][2] * (normal[1][0] * normal[2][1] - normal[1][1] * normal[2][0]);
    let inverse = minor(0, 1) / determinant;
    (inverse.is_finite() && inverse > 0.0).then_some(inverse)
}

/// The place of the least value between two places, by golden sections.
fn minimum(value: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    for _ in 0..60 {
        let (a, b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        if value(a) <= value(b) { high = b } else { low = a }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::{Parabola, power_law, slope, student_95};

    #[test]
    fn exact_powers_come_back() {
        for p in [0.5, 1.0, 2.0, 3.7, 5.0, 8.0] {
            let points: Vec<(f64, f64)> =
                (0..5).map(|k| 0.3 / 1.4_f64.powi(k)).map(|h| (h, 2.0 - 0.7 * h.powf(p))).collect();
            let found = power_law(&points).unwrap();
            // Differences of eight digits are left at order 8.
            assert!((found.value - p).abs() < 1e-5, "{p}: {found:?}");
            let lines: Vec<(f64, f64, f64)> =
                points.iter().map(|(h, _)| (h.ln(), (3.0 * h.powf(p)).ln(), 1.0 / h)).collect();
            let line = slope(&lines).unwrap();
            assert!((line.value - p).abs() < 1e-10 && line.deviation.unwrap() < 1e-6);
        }
    }

    #[test]
    fn a_parabola_comes_back_and_goes_on_straight() {
        let value = |x: f64| 3.0 - 2.0 * x + 0.5 * x * x;
        let points: Vec<(f64, f64)> = [-1.0, 0.2, 1.0, 1.5, 3.0].map(|x| (x, value(x))).to_vec();
        let fit = Parabola::through(&points, 3).unwrap();
        assert!((fit.at(2.2) - value(2.2)).abs() < 1e-12 && (fit.slope(2.2) - 0.2).abs() < 1e-12);
        assert!((fit.at(5.0) - value(3.0) - 2.0).abs() < 1e-12, "the slope at 3 is 1");
        let line = Parabola::through(&points[..2], 2).unwrap();
        assert!((line.at(-1.0) - value(-1.0)).abs() < 1e-12);
        for (count, unknowns) in [(0, 2), (1, 2), (2, 3)] {
            assert!(Parabola::through(&points[..count], unknowns).is_none());
        }
        assert!(Parabola::through(&[(1.0, 1.0), (1.0, 2.0), (1.0, 3.0)], 2).is_none(), "one place tells no slope");
    }

    #[test]
    fn noise_is_told_by_the_standard_error() {
        let noise = [0.02, -0.03, 0.01, -0.02, 0.03];
        let points: Vec<(f64, f64, f64)> =
            (0..5).map(|k| 0.5_f64.powi(k)).zip(noise).map(|(h, noise)| (h.ln(), 2.0 * h.ln() + noise, 1.0)).collect();
        let line = slope(&points).unwrap();
        let width = student_95(line.degrees_of_freedom) * line.deviation.unwrap();
        assert!((line.value - 2.0).abs() < width && width < 0.1, "{line:?}");
        assert!(slope(&points[..1]).is_none());
        assert_eq!(slope(&points[..2]).unwrap().deviation, None);
        assert_eq!(power_law(&[(1.0, 1.0), (0.5, 0.5), (0.25, 0.25)]), None);
    }
}
