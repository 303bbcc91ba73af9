//! A wall: how it moves, and what it asks of the fluids.

use crate::geometry::Vector;

/// A wall.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall<const D: usize> {
    /// Velocity of the wall; it slides along itself.
    pub velocity: Vector<D>,
    /// Whether the fluid moves with the wall; otherwise it slips along it.
    pub holds_fluid: bool,
    /// The angle at which an interface meets the wall.
    pub contact: ContactAngle,
}

/// The angle between a wall and an interface, measured in the fluid inside, in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactAngle {
    /// The line recedes below this angle.
    pub receding: f64,
    /// The line advances above this angle.
    pub advancing: f64,
}

impl ContactAngle {
    /// One angle of equilibrium.
    #[must_use]
    pub fn of(angle: f64) -> Self {
        Self { receding: angle, advancing: angle }
    }

    /// The cosine of the angle that a line is drawn to from one with this cosine: the nearest that rests.
    #[must_use]
    pub fn target(&self, cosine: f64) -> f64 {
        cosine.clamp(self.advancing.cos(), self.receding.cos())
    }

    /// Whether a line rests between two angles.
    #[must_use]
    pub fn has_hysteresis(&self) -> bool {
        self.receding < self.advancing
    }

    /// The mean of both angles.
    #[must_use]
    pub fn mean(&self) -> f64 {
        0.5 * (self.receding + self.advancing)
    }
}

/// A place beside the nearest wall.
#[derive(Debug, Clone, Copy)]
pub struct Beside<const D: usize> {
    /// Distance from the wall; negative behind it.
    pub distance: f64,
    /// Direction into the wall.
    pub normal: Vector<D>,
    /// The wall, as [`Container::wall`] counts them.
    pub wall: usize,
}

#[cfg(test)]
mod tests {
    use super::ContactAngle;

    #[test]
    fn a_line_rests_between_its_two_angles() {
        let contact = ContactAngle { receding: 1.0, advancing: 2.0 };
        assert_eq!(contact.target(1.5_f64.cos()), 1.5_f64.cos());
        assert_eq!(contact.target(0.5_f64.cos()), 1.0_f64.cos());
        assert_eq!(contact.target(2.5_f64.cos()), 2.0_f64.cos());
    }
}
