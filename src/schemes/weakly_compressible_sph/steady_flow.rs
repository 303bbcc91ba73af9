//! The steady flow between two walls, which layers of fluids come to: Couette's, Poiseuille's, and those of several layers.
//!
//! With the acceleration g along the walls and the layers' densities and viscosities the shear stress σ = η u' has the slope −ρ g and is
//! continuous, and so is u, which has the velocities of the walls at both ends. Profiles are parabolas, one for each layer.

use crate::geometry::Vector;

/// A layer across the gap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlowLayer {
    /// Its upper end, from the lower wall.
    pub top: f64,
    /// Density ρ.
    pub density: f64,
    /// Viscosity η.
    pub viscosity: f64,
}

/// Layers between two walls that hold them.
#[derive(Debug, Clone, PartialEq)]
pub struct SteadyFlow<const D: usize> {
    /// The axis across the gap.
    pub axis: usize,
    /// The lower wall.
    pub low: f64,
    /// The layers from the lower to the upper wall.
    pub layers: Vec<FlowLayer>,
    /// Velocities of the walls.
    pub walls: [Vector<D>; 2],
    /// The acceleration along the walls.
    pub acceleration: Vector<D>,
}

impl<const D: usize> SteadyFlow<D> {
    /// The velocity at a place.
    #[must_use]
    pub fn velocity(&self, x: &Vector<D>) -> Vector<D> {
        let (whole, unit) = self.integrals(f64::INFINITY);
        // u(H) = u_low + σ₀ ∫ dy/η − g ∫ (∫ ρ)/η.
        let stress = (self.walls[1] - self.walls[0] + self.acceleration * whole) / unit;
        let (weighted, unit) = self.integrals(x[self.axis] - self.low);
        self.walls[0] + stress * unit - self.acceleration * weighted
    }

    /// ∫ (∫ ρ dy)/η dy and ∫ dy/η from the lower wall to a height.
    fn integrals(&self, height: f64) -> (f64, f64) {
        let (mut weighted, mut unit, mut mass, mut bottom) = (0.0, 0.0, 0.0, 0.0);
        for FlowLayer { top, density, viscosity } in &self.layers {
            let length = (top.min(height) - bottom).max(0.0);
            weighted += (mass * length + 0.5 * density * length * length) / viscosity;
            unit += length / viscosity;
            mass += density * length;
            bottom = *top;
        }
        (weighted, unit)
    }

    /// The largest difference of velocities, by the largest speed of the steady flow.
    pub fn error(&self, positions: &[Vector<D>], velocities: &[Vector<D>]) -> f64 {
        let (mut error, mut speed) = (0.0_f64, 0.0_f64);
        for (x, velocity) in positions.iter().zip(velocities) {
            let steady = self.velocity(x);
            error = error.max((velocity - steady).norm());
            speed = speed.max(steady.norm());
        }
        error / speed
    }
}

#[cfg(test)]
mod tests {
    use super::{FlowLayer, SteadyFlow, Vector};

    #[test]
    fn profiles_are_those_of_couette_poiseuille_and_two_layers() {
        let layer = |top, viscosity| FlowLayer { top, density: 2.0, viscosity };
        let flow = |layers, top: f64, g: f64| SteadyFlow::<2> {
            axis: 1,
            low: 1.0,
            layers,
            walls: [Vector::<2>::zeros(), Vector::<2>::new(top, 0.0)],
            acceleration: Vector::<2>::new(g, 0.0),
        };
        let at = |flow: &SteadyFlow<2>, y: f64| flow.velocity(&Vector::<2>::new(0.0, 1.0 + y))[0];
        assert!((at(&flow(vec![layer(1.0, 0.1)], 3.0, 0.0), 0.25) - 0.75).abs() < 1e-14);
        // ρ g y (H − y)/(2η).
        assert!((at(&flow(vec![layer(1.0, 0.1)], 0.0, 0.4), 0.25) - 0.8 * 0.1875 / 0.2).abs() < 1e-14);
        // Of two layers in shear the stress is the same in both: u' is ten times as large in the thinner.
        let two = flow(vec![layer(0.5, 1.0), layer(1.0, 0.1)], 1.1, 0.0);
        assert!((at(&two, 0.5) - 0.1).abs() < 1e-14 && (at(&two, 0.75) - 0.6).abs() < 1e-14);
    }
}
