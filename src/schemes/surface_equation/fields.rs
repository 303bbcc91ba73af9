//! Fields whose Laplace–Beltrami operator is known.

use super::formula_field::FormulaField;
use crate::geometry::Vector;
use std::f64::consts::PI;
use std::sync::Arc;

/// A field on a surface.
#[derive(Debug, Clone, PartialEq)]
pub enum ExactField {
    /// Real orthonormal Y_lm on a sphere about the origin: m > 0 ∝ cos mφ, m < 0 ∝ sin |m|φ.
    SphericalHarmonic {
        /// Degree l.
        l: u32,
        /// Order, |m| ≤ l.
        m: i32,
        /// The axis that takes the place of z, the two behind it those of x and y.
        axis: usize,
    },
    /// sin(k·x), on any surface.
    PlaneWave {
        /// Wave vector k.
        k: Vector<3>,
    },
    /// sin mθ + cos mθ on a circle about the origin.
    SinPlusCos {
        /// Wave number m.
        m: u32,
    },
    /// ζ(|x − c|/σ)/σ² with ζ(d) = exp(−1/(1 − d²)) below d = .975: no eigenfunction, and no operator of it is known here.
    TruncatedGaussian {
        /// Center c.
        center: Vector<3>,
        /// Width σ.
        sigma: f64,
    },
    /// A formula of the place, and of the normal.
    Formula(Arc<FormulaField>),
    /// Values at the points, which a cloud keeps under this name.
    Data(&'static str),
}

impl ExactField {
    /// Whether the field is one of the place alone; formulas may name the normal.
    #[must_use]
    pub fn is_of_place(&self) -> bool {
        match self {
            Self::Formula(field) => field.is_of_place(),
            Self::Data(_) => false,
            _ => true,
        }
    }

    /// The field at a point.
    #[must_use]
    pub fn value(&self, x: &Vector<3>) -> f64 {
        match self {
            Self::SphericalHarmonic { l, m, axis } => spherical_harmonic(*l, *m, &turned(x, *axis)),
            Self::PlaneWave { k } => k.dot(x).sin(),
            Self::SinPlusCos { m } => {
                let angle = f64::from(*m) * x[1].atan2(x[0]);
                angle.sin() + angle.cos()
            }
            Self::TruncatedGaussian { center, sigma } => {
                let d = (x - center).norm() / sigma;
                if d < 0.975 { (-1.0 / (1.0 - d * d)).exp() / (sigma * sigma) } else { 0.0 }
            }
            Self::Formula(field) => field.value(x),
            // Data are known at the points of a cloud alone.
            Self::Data(_) => f64::NAN,
        }
    }

    /// Δ_S at a point with unit normal `n` and curvature ∇·n: the part of a surface in Δf − nᵀ(∇∇f)n − (∇·n) n·∇f.
    #[must_use]
    pub fn laplace_beltrami(&self, x: &Vector<3>, n: &Vector<3>, curvature: f64) -> f64 {
        match self {
            Self::SphericalHarmonic { l, .. } => -f64::from(l * (l + 1)) / x.norm_squared() * self.value(x),
            Self::PlaneWave { k } => {
                let (phase, along) = (k.dot(x), k.dot(n));
                -(k.norm_squared() - along * along) * phase.sin() - curvature * along * phase.cos()
            }
            Self::Formula(field) => field.laplace_beltrami(x, n, curvature),
            Self::SinPlusCos { .. } | Self::TruncatedGaussian { .. } | Self::Data(_) => {
                self.decay(x.norm()).map_or(f64::NAN, |rate| -rate * self.value(x))
            }
        }
    }

    /// ∇_S at a point with unit normal `n`: the tangential part of the gradient in space. None where it is not known here.
    #[must_use]
    pub fn gradient(&self, x: &Vector<3>, n: &Vector<3>) -> Option<Vector<3>> {
        match self {
            Self::PlaneWave { k } => Some((k - n * k.dot(n)) * k.dot(x).cos()),
            Self::Formula(field) if field.is_of_place() => {
                let gradient = field.gradient(x);
                Some(gradient - n * n.dot(&gradient))
            }
            Self::SphericalHarmonic { .. }
            | Self::SinPlusCos { .. }
            | Self::TruncatedGaussian { .. }
            | Self::Data(_)
            | Self::Formula(_) => None,
        }
    }

    /// λ with Δ_S f = −λ f on a sphere or a circle of a radius, for eigenfunctions.
    #[must_use]
    pub fn decay(&self, radius: f64) -> Option<f64> {
        match self {
            Self::SphericalHarmonic { l, .. } => Some(f64::from(l * (l + 1)) / (radius * radius)),
            Self::SinPlusCos { m } => Some(f64::from(*m).powi(2) / (radius * radius)),
            Self::PlaneWave { .. } | Self::TruncatedGaussian { .. } | Self::Formula(_) | Self::Data(_) => None,
        }
    }
}

/// Coordinates with `axis` as the third.
fn turned(x: &Vector<3>, axis: usize) -> Vector<3> {
    Vector::<3>::new(x[(axis + 1) % 3], x[(axis + 2) % 3], x[axis % 3])
}

/// Y_lm at the direction of x, by the recurrence in l of normalized associated Legendre functions.
fn spherical_harmonic(l: u32, m: i32, x: &Vector<3>) -> f64 {
    let z = (x[2] / x.norm()).clamp(-1.0, 1.0);
    let (order, sine) = (f64::from(m.unsigned_abs()), (1.0 - z * z).sqrt());
    // P_mm, then up in l.
    let mut last = 0.0;
    let mut now = (1..=m.unsigned_abs()).fold((0.25 / PI).sqrt(), |value, k| {
        let k = f64::from(k);
        value * ((2.0 * k + 1.0) / (2.0 * k)).sqrt() * sine
    });
    for degree in m.unsigned_abs() + 1..=l {
        let n = f64::from(degree);
        let a = ((4.0 * n * n - 1.0) / (n * n - order * order)).sqrt();
        let before = n - 1.0;
        let b = if degree == m.unsigned_abs() + 1 {
            0.0
        } else {
            ((before * before - order * order) / (4.0 * before * before - 1.0)).sqrt()
        };
        (last, now) = (now, a * (z * now - b * last));
    }
    let angle = order * f64::atan2(x[1], x[0]);
    match m {
        0 => now,
        1.. => 2.0_f64.sqrt() * now * angle.cos(),
        _ => 2.0_f64.sqrt() * now * angle.sin(),
    }
}

#[cfg(test)]
mod tests {
    use super::{ExactField, Vector, spherical_harmonic};
    use crate::geometry::fibonacci;
    use std::f64::consts::PI;

    #[test]
    fn harmonics_are_orthonormal() {
        let points = fibonacci::sphere(20_000);
        let share = 4.0 * PI / points.len() as f64;
        let pairs = [(0, 0), (1, -1), (2, 0), (4, 0), (4, 3), (4, -3), (6, 6)];
        for (i, (l, m)) in pairs.iter().enumerate() {
            for (k, (l2, m2)) in pairs.iter().enumerate() {
                let product = |x: &Vector<3>| spherical_harmonic(*l, *m, x) * spherical_harmonic(*l2, *m2, x);
                let sum: f64 = points.iter().map(product).sum::<f64>() * share;
                assert!((sum - f64::from(u8::from(i == k))).abs() < 1e-4, "({l}, {m}) ({l2}, {m2}): {sum}");
            }
        }
        // √(5/16π) (3z² − 1) and the like.
        let x = Vector::<3>::new(0.48, 0.6, 0.64);
        let expected = (5.0 / (16.0 * PI)).sqrt() * (3.0 * x[2] * x[2] - 1.0);
        assert!((spherical_harmonic(2, 0, &x) - expected).abs() < 1e-14);
        assert!((spherical_harmonic(1, -1, &(3.0 * x)) - (3.0 / (4.0 * PI)).sqrt() * x[1]).abs() < 1e-14);
    }

    #[test]
    fn decay_of_the_shortest_waves_is_a_number() {
        assert_eq!(ExactField::SinPlusCos { m: 100_000 }.decay(2.0), Some(2.5e9));
    }

    /// On a sphere of radius R the plane wave's formula against differences along great circles.
    #[test]
    fn plane_waves_have_the_operator_of_their_surface() {
        let (radius, step) = (1.7, 1e-3);
        let wave = ExactField::PlaneWave { k: Vector::<3>::new(1.0, -0.5, 2.0) };
        let n = Vector::<3>::new(0.48, 0.6, 0.64);
        let t1 = Vector::<3>::new(0.6, -0.48, 0.0).normalize();
        let t2 = n.cross(&t1);
        let on = |t: &Vector<3>, angle: f64| (n * angle.cos() + t * angle.sin()) * radius;
        let here = wave.value(&(n * radius));
        let second = |t: &Vector<3>| {
            (wave.value(&on(t, step)) + wave.value(&on(t, -step)) - 2.0 * here) / (step * radius).powi(2)
        };
        let exact = wave.laplace_beltrami(&(n * radius), &n, 2.0 / radius);
        assert!((second(&t1) + second(&t2) - exact).abs() < 1e-5);
    }
}
