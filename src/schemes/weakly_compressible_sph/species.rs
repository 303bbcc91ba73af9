//! Species: what a particle is made of. A species is an index into the table of [`Fluids`]; it decides the mass, the equation
//! of state and the viscosity of a particle, and on which side of the interface it lies.

use super::fluids::Fluid;
use std::ops::Index;

/// The species of a particle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Species {
    /// The fluid that surrounds the droplets.
    Outside,
    /// The fluid of the droplets.
    Inside,
}

impl Species {
    /// All species, in the order in which limits and reports name them.
    pub const ALL: [Self; 2] = [Self::Inside, Self::Outside];

    /// The species at a signed distance from the interface, which is negative inside.
    #[must_use]
    pub fn from_level(level: f64) -> Self {
        if level < 0.0 { Self::Inside } else { Self::Outside }
    }

    /// The species of a [`Self::code`]; None for a number that stands for no species.
    #[must_use]
    pub fn from_code(code: u64) -> Option<Self> {
        Self::ALL.into_iter().find(|species| u64::from(species.code()) == code)
    }

    /// The number of the species in frames and checkpoints (field `phase`): 0 outside, 1 inside.
    #[must_use]
    pub fn code(self) -> u8 {
        match self {
            Self::Outside => 0,
            Self::Inside => 1,
        }
    }

    /// The color c of the color field (PCP eq. B.5): 1 inside, 0 outside.
    #[must_use]
    pub fn color(self) -> f64 {
        f64::from(self.code())
    }

    /// The species on the other side of the interface.
    #[must_use]
    pub fn across_interface(self) -> Self {
        match self {
            Self::Outside => Self::Inside,
            Self::Inside => Self::Outside,
        }
    }
}

/// The table of species: the fluid of each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fluids {
    /// The fluid of the droplets.
    pub inside: Fluid,
    /// The fluid that surrounds them.
    pub outside: Fluid,
}

impl Index<Species> for Fluids {
    type Output = Fluid;

    fn index(&self, species: Species) -> &Fluid {
        match species {
            Species::Outside => &self.outside,
            Species::Inside => &self.inside,
        }
    }
}

impl Fluids {
    /// Whether all fluids agree in a constant.
    fn agree_in<T: PartialEq>(&self, constant: impl Fn(&Fluid) -> T) -> bool {
        Species::ALL.iter().all(|species| constant(&self[*species]) == constant(&self.inside))
    }

    /// Whether the fluids are the same but for the interface between them.
    #[must_use]
    pub fn are_equal(&self) -> bool {
        self.agree_in(|fluid| *fluid)
    }

    /// Whether all particles have one mass.
    #[must_use]
    pub fn have_one_mass(&self) -> bool {
        self.agree_in(|fluid| fluid.density)
    }

    /// Whether all pairs have one dynamic viscosity.
    #[must_use]
    pub fn have_one_viscosity(&self) -> bool {
        self.agree_in(|fluid| fluid.viscosity)
    }

    /// The smaller dynamic viscosity.
    #[must_use]
    pub fn least_viscosity(&self) -> f64 {
        self.inside.viscosity.min(self.outside.viscosity)
    }

    /// The least speed of sound.
    #[must_use]
    pub fn least_sound_speed(&self) -> f64 {
        Species::ALL.iter().map(|species| self[*species].sound_speed).fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::{Fluid, Fluids, Species};

    #[test]
    fn codes_are_those_of_the_field_phase_and_lead_back() {
        assert_eq!((Species::Outside.code(), Species::Inside.code()), (0, 1));
        for species in Species::ALL {
            assert_eq!(Species::from_code(u64::from(species.code())), Some(species));
            assert_eq!(species.across_interface().across_interface(), species);
            assert_ne!(species.across_interface(), species);
        }
        assert_eq!(Species::from_code(2), None);
        assert_eq!([-1.0, 0.0, 1.0].map(Species::from_level).map(Species::code), [1, 0, 0]);
    }

    #[test]
    fn fluids_are_compared_constant_by_constant() {
        let inside = Fluid { density: 1.0, viscosity: 0.5, sound_speed: 20.0, polytropic: 7.0 };
        let with = |outside| Fluids { inside, outside };
        assert!(with(inside).are_equal());
        let lighter = with(Fluid { density: 0.1, ..inside });
        assert!(!lighter.have_one_mass() && lighter.have_one_viscosity() && !lighter.are_equal());
        let softer = with(Fluid { sound_speed: 10.0, ..inside });
        assert!(softer.have_one_mass() && !softer.are_equal());
        assert_eq!(softer.least_sound_speed(), 10.0);
    }
}
