//! A standing wave between two viscous fluids, from rest: by surface tension and gravity.

mod scaled_erfc;

use nalgebra::Complex;
use scaled_erfc::scaled_erfc;

/// The wave on the plane surface between two unbounded layers of equal kinematic viscosity. It starts at rest with the shape
/// a₀ cos(kx). Where the heavier fluid is above, it grows (Rayleigh and Taylor).
///
/// Exact for small amplitudes (Prosperetti 1981). With ε = νk², ω₀² = (τk³ + (ρ₁ − ρ₂)gk)/(ρ₁ + ρ₂), ρ₁ below, and
/// β = ρ₁ρ₂/(ρ₁ + ρ₂)²:
///
/// `a/a₀ = 4(1−4β)ε²/(8(1−4β)ε² + ω₀²) erfc √(εt) + Σ (z/Z) ω₀²/(z² − ε) exp((z² − ε)t) erfc(z√t)`
///
/// over the four roots z of `z⁴ − 4β√ε z³ + 2(1−6β)ε z² + 4(1−3β)ε^{3/2} z + (1−4β)ε² + ω₀² = 0`, where Z is the product
/// of the three differences (other root − z).
#[derive(Debug, Clone, PartialEq)]
pub struct CapillaryWave {
    /// |ω₀|, the frequency or the rate of growth without viscosity.
    frequency: f64,
    /// 1, or −1 where the wave grows: ω₀² in the unit |ω₀|².
    sign: f64,
    /// ε/|ω₀|; the other numbers have 1/|ω₀| as the unit of time.
    damping: f64,
    beta: f64,
    roots: [Complex<f64>; 4],
}

impl CapillaryWave {
    /// The wave of wavenumber k = 2π/length in layers of the given densities (below, above; one may be 0), of kinematic
    /// viscosity ν, tension τ and gravity g. None where neither tension nor gravity acts.
    ///
    /// In terms of a Laplace number La = ρτλ/η² of the wavelength λ, ν = √(τλ/(ρ La)).
    #[must_use]
    pub fn new(
        wavenumber: f64,
        densities: [f64; 2],
        kinematic_viscosity: f64,
        (tension, gravity): (f64, f64),
    ) -> Option<Self> {
        let density = densities[0] + densities[1];
        let by_gravity = (densities[0] - densities[1]) * gravity * wavenumber;
        let square = (tension * wavenumber.powi(3) + by_gravity) / density;
        let (frequency, sign) = (square.abs().sqrt(), square.signum());
        if frequency == 0.0 {
            return None;
        }
        let damping = kinematic_viscosity * wavenumber.powi(2) / frequency;
        let beta = densities[0] * densities[1] / density.powi(2);
        let constant = (1.0 - 4.0 * beta) * damping.powi(2) + sign;
        let roots = quartic_roots([
            constant,
            4.0 * (1.0 - 3.0 * beta) * damping.powf(1.5),
            2.0 * (1.0 - 6.0 * beta) * damping,
            -4.0 * beta * damping.sqrt(),
        ]);
        Some(Self { frequency, sign, damping, beta, roots })
    }

    /// |ω₀|, the angular frequency or the rate of growth without viscosity.
    #[must_use]
    pub fn inviscid_frequency(&self) -> f64 {
        self.frequency
    }

    /// Amplitude a(t)/a₀ at a time t ≥ 0. Two roots approach each other in strong damping, so that rounding grows to some
    /// 1e-16 (ε/ω₀)².
    #[must_use]
    pub fn amplitude_ratio(&self, time: f64) -> f64 {
        let t = self.frequency * time;
        let share = (1.0 - 4.0 * self.beta) * self.damping.powi(2);
        let diffusion = (-self.damping * t).exp();
        let first = 4.0 * share / (8.0 * share + self.sign)
            * diffusion
            * scaled_erfc(Complex::from((self.damping * t).sqrt())).re;
        let term = |i: usize| {
            let z = self.roots[i];
            let others = (0..4).filter(|j| *j != i).map(|j| self.roots[j] - z).product::<Complex<f64>>();
            z * self.sign / (others * (z * z - self.damping)) * exp_erfc(z, t, self.damping)
        };
        first + (0..4).map(term).sum::<Complex<f64>>().re
    }
}

/// exp((z² − ε)t) erfc(z√t), by erfc(ζ) = 2 − erfc(−ζ) where the real part of z is negative.
fn exp_erfc(z: Complex<f64>, time: f64, damping: f64) -> Complex<f64> {
    let diffusion = (-damping * time).exp();
    if z.re >= 0.0 {
        scaled_erfc(z * time.sqrt()) * diffusion
    } else {
        ((z * z - damping) * time).exp() * 2.0 - scaled_erfc(-z * time.sqrt()) * diffusion
    }
}

/// The roots of z⁴ + c₃z³ + c₂z² + c₁z + c₀ by the iteration of Durand and Kerner.
fn quartic_roots(c: [f64; 4]) -> [Complex<f64>; 4] {
    // Cauchy's bound: all roots are within twice this.
    let size = (0..4).map(|k| c[k].abs().powf(1.0 / (4 - k) as f64)).fold(0.0, f64::max);
    let mut roots: [Complex<f64>; 4] = std::array::from_fn(|k| Complex::from_polar(size, 0.4 + 1.6 * k as f64));
    for _ in 0..200 {
        for i in 0..4 {
            let z = roots[i];
            let value = (((z + c[3]) * z + c[2]) * z + c[1]) * z + c[0];
            let others = (0..4).filter(|j| *j != i).map(|j| z - roots[j]).product::<Complex<f64>>();
            roots[i] = z - value / others;
        }
    }
    roots
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Times ω₀t of the references.
    const TIMES: [f64; 5] = [0.1, 1.0, 3.0, 10.0, 25.0];

    /// Wavenumber, densities, ν, and a/a₀ at the times, τ = 1. Talbot inversion with mpmath 1.3 (30 digits, 60 nodes) of the
    /// Laplace transform of the amplitude, which is solved from the four conditions on velocity and stress.
    const REFERENCES: [(f64, [f64; 2], f64, [f64; 5]); 4] = [
        // La = 3000: the wave of Popinet 1999.
        (
            TAU,
            [1.0, 1.0],
            0.0182574185835055,
            [0.9952457127743723, 0.6073835729969514, -0.6809481738380254, -0.3346214542174271, -0.0577687932493088],
        ),
        (
            TAU,
            [1.0, 0.2],
            0.05,
            [0.9952407048298051, 0.6224401122253643, -0.5288566204963706, -0.1468308054256154, -0.01203829479956695],
        ),
        (
            TAU,
            [1.0, 0.001],
            0.01,
            [0.9950209561380052, 0.554041950520938, -0.8663516889260887, -0.5745040045762075, 0.3138074495819988],
        ),
        (
            1.0,
            [1.0, 1.0],
            3.0,
            [0.9968511339273951, 0.9061558537153516, 0.7123663162004447, 0.306631615940407, 0.05036698314882436],
        ),
    ];

    type Growing = ([f64; 2], f64, (f64, f64), [f64; 3]);
    /// Below, above, ν, τ and g, and a/a₀ at |ω₀|t = 1, 3 and 6, with k = 2π; found in the same way.
    const GROWING: [Growing; 3] = [
        ([1.0, 3.0], 0.01, (0.0, 1.0), [1.398_846_441_745_692_6, 5.384_029_958_071_491, 46.847_027_008_795_68]),
        ([1.0, 3.0], 0.02, (0.02, 1.0), [1.314_242_544_637_559_4, 3.575_583_675_972_383, 17.469_922_183_512_454]),
        ([0.1, 1.0], 0.005, (0.005, 2.0), [1.486_967_873_723_678, 7.821_851_313_592_719, 111.266_918_798_055_14]),
    ];

    #[test]
    fn amplitudes_agree_with_a_numerical_laplace_inversion() {
        for (wavenumber, densities, viscosity, amplitudes) in REFERENCES {
            let wave = CapillaryWave::new(wavenumber, densities, viscosity, (1.0, 0.0)).unwrap();
            for (time, reference) in TIMES.into_iter().zip(amplitudes) {
                let amplitude = wave.amplitude_ratio(time / wave.inviscid_frequency());
                // Rounding of the phase, 1e-16 ω₀t, and of the roots, 1e-16 (ε/ω₀)², where (ε/ω₀)² = 18 in the last row.
                assert!((amplitude - reference).abs() < 2e-14, "{amplitude}, not {reference}");
            }
        }
    }

    #[test]
    fn limits_of_no_viscosity_and_of_much() {
        let inviscid = CapillaryWave::new(1.0, [1.0, 0.3], 0.0, (2.0, 0.0)).unwrap();
        let strong = CapillaryWave::new(1.0, [1.0, 1.0], 100.0, (1.0, 0.0)).unwrap();
        // Creeping flow: a' = −τk a/(2(η₁ + η₂)), up to inertia of relative size (ω₀/ε)², here 5e-5.
        let creeping = -1.0 / 400.0;
        for time in [0.0_f64, 1.0, 30.0] {
            let cosine = (inviscid.inviscid_frequency() * time).cos();
            assert!((inviscid.amplitude_ratio(time) - cosine).abs() < 1e-14);
            assert!((strong.amplitude_ratio(time) - (creeping * time).exp()).abs() < 5e-5);
        }
    }

    #[test]
    fn heavier_fluid_above_lets_waves_grow_as_a_numerical_laplace_inversion_says() {
        for (densities, viscosity, forces, amplitudes) in GROWING {
            let wave = CapillaryWave::new(TAU, densities, viscosity, forces).unwrap();
            for (time, reference) in [1.0, 3.0, 6.0].into_iter().zip(amplitudes) {
                let amplitude = wave.amplitude_ratio(time / wave.inviscid_frequency());
                assert!((amplitude / reference - 1.0).abs() < 1e-11, "{amplitude}, not {reference}");
            }
        }
        let inviscid = CapillaryWave::new(TAU, [1.0, 3.0], 0.0, (0.0, 1.0)).unwrap();
        assert!((inviscid.inviscid_frequency() - (0.5 * TAU).sqrt()).abs() < 1e-14);
        assert!((inviscid.amplitude_ratio(1.0) - (0.5 * TAU).sqrt().cosh()).abs() < 1e-12);
        assert_eq!(CapillaryWave::new(TAU, [1.0, 1.0], 0.1, (0.0, 1.0)), None);
    }
}
