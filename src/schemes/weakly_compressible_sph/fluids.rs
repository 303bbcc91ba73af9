//! The constants of a fluid and its equation of state.

/// A fluid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fluid {
    /// Reference density ρ₀.
    pub density: f64,
    /// Dynamic viscosity η.
    pub viscosity: f64,
    /// Speed of sound c.
    pub sound_speed: f64,
    /// Exponent γ of the equation of state.
    pub polytropic: f64,
}

impl Fluid {
    /// The pressure at a density, P = c² ρ₀/γ ((ρ/ρ₀)^γ − 1) (PCP eq. 27).
    #[must_use]
    pub fn pressure(&self, density: f64) -> f64 {
        let ratio = density / self.density;
        // A whole exponent costs a few multiplications.
        let whole = self.polytropic.round();
        let power = if (whole - self.polytropic).abs() < 1e-12 {
            ratio.powi(whole as i32)
        } else {
            ratio.powf(self.polytropic)
        };
        self.sound_speed * self.sound_speed * self.density / self.polytropic * (power - 1.0)
    }

    /// The density at a pressure: the inverse of [`Self::pressure`].
    #[must_use]
    pub fn density_at(&self, pressure: f64) -> f64 {
        let stiffness = self.sound_speed * self.sound_speed * self.density / self.polytropic;
        self.density * (1.0 + pressure / stiffness).max(0.0).powf(1.0 / self.polytropic)
    }

    /// The elastic energy of a unit of mass at a density, e = ∫ P/ρ² dρ from ρ₀:
    /// c²/γ ((x^(γ−1) − 1)/(γ − 1) + 1/x − 1) with x = ρ/ρ₀.
    #[must_use]
    pub fn elastic_energy(&self, density: f64) -> f64 {
        let (x, power) = (density / self.density, self.polytropic - 1.0);
        let compressed = if power < 1e-9 { x.ln() } else { (x.powf(power) - 1.0) / power };
        self.sound_speed * self.sound_speed / self.polytropic * (compressed + 1.0 / x - 1.0)
    }

    /// The kinematic viscosity ν = η/ρ₀.
    #[must_use]
    pub fn kinematic_viscosity(&self) -> f64 {
        self.viscosity / self.density
    }
}

#[cfg(test)]
mod tests {
    use super::Fluid;

    #[test]
    fn pressure_vanishes_at_rest_and_its_slope_is_the_square_of_the_speed_of_sound() {
        for polytropic in [1.0, 1.4, 7.0] {
            let fluid = Fluid { density: 1.3, viscosity: 0.5, sound_speed: 20.0, polytropic };
            assert_eq!(fluid.pressure(1.3), 0.0);
            assert!((fluid.density_at(fluid.pressure(1.42)) - 1.42).abs() < 1e-12);
            let slope = (fluid.pressure(1.3 + 1e-6) - fluid.pressure(1.3 - 1e-6)) / 2e-6;
            assert!((slope - 400.0).abs() < 1e-3, "{slope}");
            assert_eq!(fluid.elastic_energy(1.3), 0.0);
            let density = 1.42;
            let slope = (fluid.elastic_energy(density + 1e-4) - fluid.elastic_energy(density - 1e-4)) / 2e-4;
            let expected = fluid.pressure(density) / (density * density);
            assert!((slope - expected).abs() < 1e-4 * expected, "{slope} {expected}");
        }
    }
}
