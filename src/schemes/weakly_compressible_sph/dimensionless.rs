//! Dimensionless numbers of two fluids with surface tension.

use super::species::Fluids;
use crate::simulation::Diagnostic;

/// What dimensionless numbers are made of.
#[derive(Debug, Clone, Copy)]
pub struct Scales {
    /// The fluids; numbers are those of the fluid inside.
    pub fluids: Fluids,
    /// Surface tension τ.
    pub tension: f64,
    /// Diameter D of the smallest drop as a ball.
    pub diameter: f64,
    /// A speed U.
    pub speed: f64,
    /// Size g of a constant body force.
    pub gravity: f64,
    /// Spacing h of the particles.
    pub spacing: f64,
}

/// Dimensionless numbers; not finite where one is not defined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DimensionlessNumbers {
    /// Laplace number La = τρD/η².
    pub laplace: f64,
    /// Ohnesorge number Oh = η/√(ρτD).
    pub ohnesorge: f64,
    /// Reynolds number Re = ρUD/η.
    pub reynolds: f64,
    /// Weber number We = ρU²D/τ.
    pub weber: f64,
    /// Capillary number Ca = ηU/τ.
    pub capillary: f64,
    /// Bond number Bo = |ρ − ρ_outside| g D²/τ.
    pub bond: f64,
    /// Density outside by that inside.
    pub density_ratio: f64,
    /// Viscosity outside by that inside.
    pub viscosity_ratio: f64,
    /// D/h.
    pub diameter_over_h: f64,
    /// R/h = D/(2h).
    pub radius_over_h: f64,
}

impl From<Scales> for DimensionlessNumbers {
    fn from(Scales { fluids, tension, diameter, speed, gravity, spacing }: Scales) -> Self {
        let (inside, outside) = (fluids.inside, fluids.outside);
        let (density, viscosity) = (inside.density, inside.viscosity);
        Self {
            laplace: tension * density * diameter / (viscosity * viscosity),
            ohnesorge: viscosity / (density * tension * diameter).sqrt(),
            reynolds: density * speed * diameter / viscosity,
            weber: density * speed * speed * diameter / tension,
            capillary: viscosity * speed / tension,
            bond: (density - outside.density).abs() * gravity * diameter * diameter / tension,
            density_ratio: outside.density / density,
            viscosity_ratio: outside.viscosity / viscosity,
            diameter_over_h: diameter / spacing,
            radius_over_h: 0.5 * diameter / spacing,
        }
    }
}

impl DimensionlessNumbers {
    /// The numbers that are defined, as entries of a report.
    #[must_use]
    pub fn diagnostics(&self) -> Vec<Diagnostic> {
        let all = [
            Diagnostic::new("numbers.La", self.laplace, "Laplace number, tau rho D/eta^2 of the fluid inside."),
            Diagnostic::new("numbers.Oh", self.ohnesorge, "Ohnesorge number, eta/sqrt(rho tau D)."),
            Diagnostic::new(
                "numbers.Re",
                self.reynolds,
                "Reynolds number, rho U D/eta with the largest speed measured.",
            ),
            Diagnostic::new("numbers.We", self.weber, "Weber number, rho U^2 D/tau with the largest speed measured."),
            Diagnostic::new(
                "numbers.Ca",
                self.capillary,
                "Capillary number, eta U/tau with the largest speed measured.",
            ),
            Diagnostic::new("numbers.Bo", self.bond, "Bond number, difference of densities times g D^2/tau."),
            Diagnostic::new("numbers.density_ratio", self.density_ratio, "Density outside by that inside."),
            Diagnostic::new("numbers.viscosity_ratio", self.viscosity_ratio, "Viscosity outside by that inside."),
            Diagnostic::new("numbers.D_over_h", self.diameter_over_h, "Diameter of the smallest drop by the spacing."),
            Diagnostic::new("numbers.R_over_h", self.radius_over_h, "Radius of the smallest drop by the spacing."),
        ];
        all.into_iter().filter(|number| number.value.is_finite()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::{DimensionlessNumbers, Scales};
    use crate::schemes::weakly_compressible_sph::{Fluid, Fluids};

    #[test]
    fn numbers_are_those_of_water_in_air_and_do_not_depend_on_units() {
        let fluid = |density, viscosity| Fluid { density, viscosity, sound_speed: 1.0, polytropic: 7.0 };
        let fluids = Fluids { inside: fluid(1000.0, 1e-3), outside: fluid(1.2, 1.8e-5) };
        let scales = Scales { fluids, tension: 0.072, diameter: 1e-3, speed: 0.1, gravity: 9.81, spacing: 5e-5 };
        let numbers = DimensionlessNumbers::from(scales);
        let near = |got: f64, expected: f64| assert!((got / expected - 1.0).abs() < 1e-12, "{got}, not {expected}");
        near(numbers.laplace, 72_000.0);
        near(numbers.laplace * numbers.ohnesorge.powi(2), 1.0);
        near(numbers.reynolds, 100.0);
        near(numbers.weber, 10.0 / 72.0);
        near(numbers.capillary, numbers.weber / numbers.reynolds);
        near(numbers.bond, 998.8 * 9.81e-6 / 0.072);
        near(numbers.radius_over_h, 10.0);
        // Millimeters, milligrams, milliseconds.
        let fluids = Fluids { inside: fluid(1.0, 1e-3), outside: fluid(1.2e-3, 1.8e-5) };
        let scales = Scales { fluids, tension: 0.072, diameter: 1.0, speed: 0.1, gravity: 9.81e-3, spacing: 0.05 };
        let again = DimensionlessNumbers::from(scales);
        near(again.laplace, numbers.laplace);
        near(again.bond, numbers.bond);
        let inviscid = Scales { fluids: Fluids { inside: fluid(1.0, 0.0), ..fluids }, ..scales };
        let named = DimensionlessNumbers::from(inviscid).diagnostics();
        assert!(named.iter().all(|number| number.name != "numbers.La") && named.len() == 7, "{named:?}");
    }
}
