//! Frequency and decay of a shape mode of a viscous drop in a viscous fluid.
//!
//! Sources (docs/bibliography.md): Lamb 1932, Miller 1968, Prosperetti 1980. The plane is derived in the same way; the
//! dimension d enters by a few numbers only.
//!
//! With the radius as the unit of length, the flow of mode n and growth rate s has `u_r ∝ f/r` and a tangential
//! velocity ∝ `f' + (d−2) f/r`. `f` is `A rⁿ + B b(r)` inside and `C r^−m + D b(r)` outside, m = n + d − 2, where
//! `b = r^(1−d/2) I_ν(z r)` or `r^(1−d/2) K_ν(z r)`, ν = n + d/2 − 1, and z = R √(s ρ/η). With F and G for `f` and `f'` at
//! the surface (both continuous) and Q = z² b(1) for the share of b:
//!
//! * `Q_i = (G − n F) z I_ν/I_{ν+1}` and `Q_o = −(G + m F) z K_ν/K_{ν−1}`;
//! * tangential stress ∝ η (Q + 2(n m − d + 2) F − 2 G), continuous;
//! * radial stress ∝ −p + 2η (G − F), with `p_i = −(ρ_i s R² F − η_i Q_i)/n`, `p_o = (ρ_o s R² F − η_o Q_o)/m`; its jump
//!   (outside − inside) is the tension times the change of curvature, `τ (n−1)(n+d−1) F/(s R)`.
//!
//! A surfactant of the elasticity E = −Γ dτ/dΓ that is stretched by ∇_s·u = (F − G)/R, and spreads with the diffusivity D,
//! changes the tension by `M (F − G)`, M = E/(R (s + D n m/R²)). The tangential jump is its gradient, `n m M (F − G)` in
//! the units above; the radial one has `(d−1) M (F − G)` besides.

use super::bessel_ratios::{ratio_i, ratio_k};
use nalgebra::Complex;

/// A fluid. Both numbers positive, or a viscosity of 0; both 0 stand for a vacuum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fluid {
    /// Density ρ.
    pub density: f64,
    /// Dynamic viscosity η.
    pub viscosity: f64,
}

/// Angular frequency and decay rate `(ω, δ)` of the shape mode n ≥ 2 of a circle (dimension 2) or sphere (dimension 3) in
/// an unbounded fluid: the amplitude goes like exp(−δt) cos(ωt + φ).
///
/// The pair satisfies the full viscous dispersion relation (see the file's head) to about 1e-12. It is the mode that
/// continues Lamb's inviscid mode; `None` where no such mode oscillates, which happens in fluids that are too viscous.
/// An initial shape at rest excites the mode and a transient of vorticity; the pair describes the time after it.
pub fn two_fluid_drop_mode(
    dimension: usize,
    mode: usize,
    radius: f64,
    inside: Fluid,
    outside: Fluid,
    tension: f64,
) -> Option<(f64, f64)> {
    confined_drop_mode(dimension, mode, radius, inside, outside, tension, 0.0)
}

/// [`two_fluid_drop_mode`] with a potential outside that boundaries reflect: its `r^−m` becomes `r^−m − β rⁿ` (r in radii)
/// with the reflection β of [`reflection_of_circle`] or [`reflection_of_square_box`].
///
/// Vorticity is still that of an unbounded fluid: the distance to the boundary must be several √(2η/ρω).
pub fn confined_drop_mode(
    dimension: usize,
    mode: usize,
    radius: f64,
    inside: Fluid,
    outside: Fluid,
    tension: f64,
    reflection: f64,
) -> Option<(f64, f64)> {
    Drop { dimension, mode, radius, inside, outside, tension, reflection, elastic: Elastic::NONE }.oscillation()
}

/// What a surfactant adds to an interface.
#[derive(Debug, Clone, Copy)]
pub struct Elastic {
    /// E = −Γ dτ/dΓ.
    pub elasticity: f64,
    /// Diffusivity along the interface.
    pub diffusivity: f64,
}

impl Elastic {
    /// A clean interface.
    pub const NONE: Self = Self { elasticity: 0.0, diffusivity: 0.0 };
}

/// Lamb's frequency of the same drop in fluids without viscosity: ω² = τ (n−1)(n+d−1)/(R³ (ρ_i/n + ρ_o/(n+d−2))).
pub fn inviscid_drop_frequency(
    dimension: usize,
    mode: usize,
    radius: f64,
    inside: Fluid,
    outside: Fluid,
    tension: f64,
) -> f64 {
    let (reflection, elastic) = (0.0, Elastic::NONE);
    Drop { dimension, mode, radius, inside, outside, tension, reflection, elastic }.inviscid_frequency()
}

/// Reflection β = (R/b)^(2n+d−2) by a concentric circle or sphere of radius b that no fluid passes.
///
/// The boundary layer at b is left out: against a circle without shear stress, ω differs by 3e-4 and the decay by 1 % at
/// b = 2R in the plane, n = 2, with a Laplace number 2ρτR/η² of 8000.
pub fn reflection_of_circle(dimension: usize, mode: usize, radius: f64, boundary: f64) -> f64 {
    (radius / boundary).powi((2 * mode + dimension - 2) as i32)
}

/// Reflection of mode 2 in the plane by the images in a periodic square box (or by slip walls) of side L, for a drop
/// stretched along the sides: β = 3 G₄ (R/L)⁴. A drop stretched along the diagonals has −β.
///
/// The potential of the drop and its images is Weierstrass' ℘(z) = z⁻² + 3 G₄ z² + O(z⁶), where G₄ is the sum of w⁻⁴ over
/// the points of the lattice of unit side without the origin. The term of order 6 is left out, which changes ω by less
/// than 1e-4 for R ≤ 0.35 L.
pub fn reflection_of_square_box(radius: f64, side: f64) -> f64 {
    const G4: f64 = 3.151_212_002_153_897;
    3.0 * G4 * (radius / side).powi(4)
}

/// What the dispersion relation depends on.
pub struct Drop {
    /// 2 or 3.
    pub dimension: usize,
    /// n.
    pub mode: usize,
    /// R.
    pub radius: f64,
    pub inside: Fluid,
    pub outside: Fluid,
    /// τ, of the covered interface where there is a surfactant.
    pub tension: f64,
    /// β of the potential outside.
    pub reflection: f64,
    pub elastic: Elastic,
}

impl Drop {
    /// Angular frequency and decay rate, as [`two_fluid_drop_mode`] has them.
    pub fn oscillation(&self) -> Option<(f64, f64)> {
        let frequency = self.inviscid_frequency();
        if self.inside.viscosity == 0.0 && self.outside.viscosity == 0.0 {
            return Some((frequency, 0.0));
        }
        // From weak damping, where the inviscid mode is a good start, to the asked viscosities; each step is small enough for
        // the secants to stay on the mode.
        let mut rate = Complex::new(-0.01 * frequency, frequency);
        for step in (0..=32).rev() {
            let share = 2.0_f64.powf(-0.25 * f64::from(step));
            rate = root_near(rate, |s| self.determinant(s, [share, 0.0]))?;
            if rate.im < 1e-6 * frequency {
                return None;
            }
        }
        if self.elastic.elasticity > 0.0 {
            // The same from a clean interface to the asked elasticity.
            for step in 1..=64 {
                rate = root_near(rate, |s| self.determinant(s, [1.0, f64::from(step) / 64.0]))?;
            }
        }
        Some((rate.im, -rate.re))
    }

    /// n and m = n + d − 2.
    fn exponents(&self) -> (f64, f64) {
        (self.mode as f64, (self.mode + self.dimension - 2) as f64)
    }

    /// τ (n−1)(n+d−1): R² times the change of τκ by a displacement of 1.
    fn stiffness(&self) -> f64 {
        self.tension * ((self.mode - 1) * (self.mode + self.dimension - 1)) as f64
    }

    /// Pressure outside and slope of the potential part of f at the surface, by its value: p = ρ s R² κ f, f' = −μ f.
    /// Without reflection κ = 1/m and μ = m.
    fn outer_potential(&self) -> (f64, f64) {
        let ((n, m), beta) = (self.exponents(), self.reflection);
        ((1.0 / m + beta / n) / (1.0 - beta), (m + beta * n) / (1.0 - beta))
    }

    fn inviscid_frequency(&self) -> f64 {
        let inertia = self.inside.density / self.mode as f64 + self.outside.density * self.outer_potential().0;
        (self.stiffness() / (inertia * self.radius.powi(3))).sqrt()
    }

    /// The determinant of the two stress conditions in F and G at growth rate s, both viscosities and the elasticity times their
    /// shares.
    fn determinant(&self, s: Complex<f64>, [share, elastic_share]: [f64; 2]) -> Complex<f64> {
        let ((n, m), (kappa, mu)) = (self.exponents(), self.outer_potential());
        let d = self.dimension as f64;
        let order = n + d / 2.0 - 1.0;
        let (eta_i, eta_o) = (self.inside.viscosity * share, self.outside.viscosity * share);
        let argument = |fluid: Fluid| (s * (fluid.density / (fluid.viscosity * share))).sqrt() * self.radius;
        // η Q = q (G − n F) inside and q (G + μ F) outside; 0 without viscosity.
        let q_i = if eta_i > 0.0 { ratio_i(order, argument(self.inside)) * eta_i } else { Complex::ZERO };
        let q_o = if eta_o > 0.0 {
            let z = argument(self.outside);
            let z2 = z * z;
            z2 * eta_o / (Complex::from(mu - m) - z2 / ratio_k(order, z))
        } else {
            Complex::ZERO
        };
        let shear = 2.0 * (n * m - d + 2.0) * (eta_i - eta_o);
        let spreading = self.elastic.diffusivity * n * m / self.radius.powi(2);
        let stretch = (s + spreading).inv() * (elastic_share * self.elastic.elasticity / self.radius);
        let along = stretch * (n * m);
        let tangential = (-q_i * n - q_o * mu + shear - along, q_i - q_o - 2.0 * (eta_i - eta_o) + along);
        let inertia = s * self.radius.powi(2) * (self.inside.density / n + self.outside.density * kappa);
        let radial = (
            -inertia - q_i + q_o * kappa * mu + 2.0 * (eta_i - eta_o)
                - self.stiffness() / (s * self.radius)
                - stretch * (d - 1.0),
            q_i / n + q_o * kappa - 2.0 * (eta_i - eta_o) + stretch * (d - 1.0),
        );
        tangential.0 * radial.1 - tangential.1 * radial.0
    }
}

/// The root of an analytic function by secants from a start nearby; `None` if they do not settle.
fn root_near(start: Complex<f64>, function: impl Fn(Complex<f64>) -> Complex<f64>) -> Option<Complex<f64>> {
    let (mut a, mut b) = (start, start * 1.0001);
    let mut at_a = function(a);
    for _ in 0..60 {
        let at_b = function(b);
        let step = at_b * (b - a) / (at_b - at_a);
        if step.norm() < 1e-12 * b.norm() || at_b == Complex::ZERO {
            return Some(if step.is_finite() { b - step } else { b });
        }
        (a, at_a) = (b, at_b);
        b -= step;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn fluid(density: f64, viscosity: f64) -> Fluid {
        Fluid { density, viscosity }
    }

    fn assert_mode(found: Option<(f64, f64)>, reference: (f64, f64), tolerance: f64) {
        let (omega, decay) = found.unwrap();
        let error = (omega - reference.0).hypot(decay - reference.1) / reference.0.hypot(reference.1);
        assert!(error < tolerance, "({omega}, {decay}), not {reference:?}: {error:e}");
    }

    type Row = (usize, usize, f64, Fluid, Fluid, f64, (f64, f64));

    /// Dimension, n, radius, inside, outside, tension, (ω, δ). Roots of the determinant of the four conditions on velocity
    /// and stress in A, B, C, D, with mpmath 1.3: Bessel functions of 30 digits, every derivative taken numerically.
    /// 2R = 1 and η = (1/La)^(1/2) for the Laplace numbers 120, 12,000 and 1e5; then ratios of densities and viscosities.
    const REFERENCES: [Row; 13] = [
        (2, 2, 0.4, fluid(1.0, 0.01), fluid(1.0, 0.01), 1.0, (6.38311399967552, 0.525277915869585)),
        (2, 2, 0.5, fluid(1.0, 0.091287), fluid(1.0, 0.091287), 1.0, (3.83650356694592, 1.36196464635532)),
        (2, 2, 0.5, fluid(1.0, 0.003162), fluid(1.0, 0.003162), 1.0, (4.72291922894055, 0.188668489489382)),
        (2, 3, 0.5, fluid(1.0, 0.02), fluid(0.2, 0.002), 1.0, (12.1304116852076, 0.945429220525302)),
        (2, 2, 0.5, fluid(1.0, 0.01), fluid(1.0, 0.1), 1.0, (4.05326631400884, 1.14071695041897)),
        (2, 4, 0.4, fluid(1.0, 0.003), fluid(0.001, 0.0001), 2.0, (43.2308767588824, 0.457510369606438)),
        (3, 2, 0.4, fluid(1.0, 0.01), fluid(1.0, 0.01), 1.0, (8.00784503622628, 0.747984073787029)),
        (3, 2, 0.5, fluid(1.0, 0.091287), fluid(1.0, 0.091287), 1.0, (4.66190966464524, 1.96034437411079)),
        (3, 2, 0.5, fluid(1.0, 0.009129), fluid(1.0, 0.009129), 1.0, (5.77529826073698, 0.477495104678642)),
        (3, 2, 0.5, fluid(1.0, 0.003162), fluid(1.0, 0.003162), 1.0, (5.94919139552353, 0.267187722490843)),
        (3, 3, 0.5, fluid(1.0, 0.02), fluid(0.2, 0.002), 1.0, (13.8492802857014, 1.12238278409357)),
        (3, 2, 0.5, fluid(0.2, 0.002), fluid(1.0, 0.02), 1.0, (8.06808103954134, 1.056264601694)),
        (3, 2, 0.5, fluid(1.0, 0.5), fluid(1.0, 0.5), 1.0, (0.474005409643417, 2.18003131086199)),
    ];

    #[test]
    fn modes_agree_with_the_determinant_in_many_digits() {
        for (dimension, mode, radius, inside, outside, tension, reference) in REFERENCES {
            // The secants stop at a step of 1e-12, when the next would be at rounding, about 1e-14.
            let found = two_fluid_drop_mode(dimension, mode, radius, inside, outside, tension);
            assert_mode(found, reference, 1e-12);
        }
    }

    #[test]
    fn weak_damping_is_that_of_the_boundary_layers() {
        // Miller 1968, two fluids: δ = (2n+1)² √(ω η_i ρ_i η_o ρ_o / 2) / (2 Γ (√(η_i ρ_i) + √(η_o ρ_o))) with
        // Γ = (n+1) ρ_i + n ρ_o and R = 1; the frequency falls by as much. The next order is ν against √(νω).
        let (inside, outside) = (fluid(1.0, 1e-8), fluid(0.5, 4e-8));
        let inviscid = inviscid_drop_frequency(3, 2, 1.0, inside, outside, 1.0);
        assert!((inviscid - (24.0_f64 / 4.0).sqrt()).abs() < 1e-14);
        let impedance = |fluid: Fluid| (fluid.density * fluid.viscosity).sqrt();
        let decay = 25.0 * (inviscid / 2.0).sqrt() * impedance(inside) * impedance(outside)
            / (8.0 * (impedance(inside) + impedance(outside)));
        let (omega, found) = two_fluid_drop_mode(3, 2, 1.0, inside, outside, 1.0).unwrap();
        assert!((found / decay - 1.0).abs() < 5e-3, "{found}, not {decay}");
        assert!(((inviscid - omega) / decay - 1.0).abs() < 5e-3, "{omega}");
    }

    #[test]
    fn a_free_drop_and_a_bubble_have_lambs_damping() {
        // Lamb 1932 §355: (n−1)(2n+1)ν/R² for a drop in a vacuum, (n+2)(2n+1)ν/R² for a cavity; 2n(n∓1)ν/R² in the plane.
        // The next order is √(ν/ωR²) = 2e-4 times a factor of some units.
        let (liquid, vacuum) = (fluid(1.0, 1e-7), fluid(0.0, 0.0));
        for (dimension, drop, bubble) in [(2, 12.0, 24.0), (3, 14.0, 35.0)] {
            for (inside, outside, factor) in [(liquid, vacuum, drop), (vacuum, liquid, bubble)] {
                let (_, decay) = two_fluid_drop_mode(dimension, 3, 1.0, inside, outside, 1.0).unwrap();
                assert!((decay / (factor * 1e-7) - 1.0).abs() < 2e-3, "{dimension} {decay}");
            }
        }
    }

    #[test]
    fn a_free_drop_stops_oscillating_at_the_known_viscosity() {
        // Chandrasekhar 1961 §98: mode 2 is aperiodic for ω₀R²/ν < 3.69.
        let vacuum = fluid(0.0, 0.0);
        let mode = |number: f64| two_fluid_drop_mode(3, 2, 1.0, fluid(1.0, 8.0_f64.sqrt() / number), vacuum, 1.0);
        assert!(mode(3.72).is_some() && mode(3.66).is_none(), "{:?} {:?}", mode(3.72), mode(3.66));
    }

    #[test]
    fn a_square_box_slows_the_mode_as_its_lattice_sums_say() {
        // Reference: modes 2, 6, 10 and 14 coupled by their lattice sums, without viscosity, R = L/4. The single term of the
        // function leaves out the coupling, (3/4)² (R/L)^8 ≈ 1e-5 of the square at most.
        let water = fluid(1.0, 0.0);
        let (omega, decay) =
            confined_drop_mode(2, 2, 1.0, water, water, 1.0, reflection_of_square_box(0.25, 1.0)).unwrap();
        assert!((omega - 1.699768599).abs() < 1e-6 && decay == 0.0, "{omega}");
        assert!((inviscid_drop_frequency(2, 2, 1.0, water, water, 1.0) - 3.0_f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn a_circle_around_the_drop_slows_the_mode() {
        // Reference: determinant of six conditions with mpmath, no shear stress on the outer circle of radius b. Its boundary
        // layer, which the reflection leaves out, changes the rate by a part of νn²/b² = 0.06, here 0.005 of 6.2.
        let water = fluid(1.0, 0.01);
        for (boundary, reference) in
            [(0.8, (6.1427438052883, 0.55291659493053)), (1.2, (6.336526486389, 0.53096719280722))]
        {
            let reflection = reflection_of_circle(2, 2, 0.4, boundary);
            let found = confined_drop_mode(2, 2, 0.4, water, water, 1.0, reflection);
            assert_mode(found, reference, 1e-3);
        }
    }
}
