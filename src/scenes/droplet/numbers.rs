//! The numbers that characterize a droplet scene: its size and its speeds.

use super::spec::{Droplet, FluidSpec};
use crate::geometry::Vector;
use crate::scenes::shapes::{Shape, ShapeSurface};
use crate::schemes::weakly_compressible_sph::ball_curvature;
use crate::simulation::Finding;
use crate::spec::Violation;
use serde_json::json;

/// Factors of the speeds that a scene is expected to reach.
struct Tuning {
    /// Of √(2τκ/ρ): balanced forces leave speeds of 0.2 to 0.3 of it (measured).
    capillary: f64,
    /// c² in units of the largest of u², τ/(ρR) and gL below which compression shows.
    stiffness: f64,
}

const TUNING: Tuning = Tuning { capillary: 0.3, stiffness: 100.0 };

/// Size, tension and acceleration of a scene.
#[derive(Debug, Clone, Copy)]
pub(super) struct SceneNumbers {
    /// Radius of the smallest drop as a ball, or half the length of a layer's waves; None for drops that are known by points
    /// alone.
    pub radius: Option<f64>,
    /// Curvature of a ball of that radius, or of one in the shortest side of the box.
    curvature: f64,
    pub tension: f64,
    /// Largest tension at the start.
    largest_tension: f64,
    /// Size of a constant body force.
    pub gravity: f64,
    /// Size of the velocity at the start.
    start_speed: f64,
    /// Largest speed of the fluids at the start about that velocity.
    own_speed: f64,
    /// Longest side of the box.
    length: f64,
}

impl SceneNumbers {
    pub fn new<const D: usize>(
        radius: Option<f64>,
        [tension, largest_tension]: [f64; 2],
        [gravity, start_speed, own_speed]: [f64; 3],
        lengths: &Vector<D>,
    ) -> Self {
        let curvature = (D - 1) as f64 / radius.unwrap_or(0.5 * lengths.min());
        Self { radius, curvature, tension, largest_tension, gravity, start_speed, own_speed, length: lengths.max() }
    }

    /// The largest speed that a scene is expected to reach, that of the start included.
    pub fn expected_speed(&self, spec: &Droplet) -> f64 {
        self.expected_inner_speed(spec) + self.start_speed
    }

    /// The largest speed about the velocity of the start that a scene is expected to reach, 0.3 √(2τκ/ρ) + √(2gL).
    pub fn expected_inner_speed(&self, spec: &Droplet) -> f64 {
        let density = spec.fluids.inside.density.min(spec.fluids.outside.density);
        TUNING.capillary * (2.0 * self.largest_tension * self.curvature / density).sqrt()
            + self.falling_speed()
            + self.own_speed
    }

    fn falling_speed(&self) -> f64 {
        (2.0 * self.gravity * self.length).sqrt()
    }

    /// The least speed of sound of a fluid of the scene.
    pub fn least_sound_speed(&self, fluid: &FluidSpec) -> f64 {
        let fall = (self.gravity * self.length).max(self.own_speed * self.own_speed);
        least_sound_speed(fluid, self.radius, self.largest_tension, fall)
    }

    /// A warning for each fluid that is softer than c² = 100 max(τ/(ρR), gL, u²).
    pub fn soft_fluids(&self, spec: &Droplet) -> Vec<Finding> {
        let fluids = [("inside", &spec.fluids.inside), ("outside", &spec.fluids.outside)];
        let soft = fluids.into_iter().map(|(name, fluid)| (name, fluid.sound_speed, self.least_sound_speed(fluid)));
        let soft = soft.filter(|(_, sound_speed, least)| sound_speed < least);
        soft.map(|(name, sound_speed, least)| {
            let message = format!(
                "the fluid {name} is compressed: its speed of sound is {sound_speed}, 100 max(τ/(ρR), gL, u²) asks for {least:.4}"
            );
            Finding::warning("soft_fluid", message, (0, 0.0)).with_advice("a higher speed of sound helps")
        })
        .collect()
    }

    /// Refuses speeds of sound below half of the least one, unless the scene allows soft fluids.
    pub fn check_sound_speeds(&self, spec: &Droplet, errors: &mut Vec<Violation>) {
        for (name, fluid) in [("inside", &spec.fluids.inside), ("outside", &spec.fluids.outside)] {
            let least = self.least_sound_speed(fluid);
            if fluid.sound_speed < 0.5 * least && !spec.allow_soft {
                let detail = format!(
                    "the fluid would be compressed: c² = 100 max(τ/(ρR), gL, u²) asks for {least:.4}, half of it is the least; \
                     allow_soft lets it through"
                );
                let pointer = format!("/fluids/{name}/sound_speed");
                let allowed = json!(format!("a number ≥ {:.6e}", 0.5 * least));
                errors.push(Violation::new(pointer, "range", detail, fluid.sound_speed, allowed));
            }
        }
    }
}

/// The least speed of sound that keeps a fluid nearly incompressible: c² = 100 max(τ/(ρR), gL, u²). `fall` is the larger of gL and u².
pub(super) fn least_sound_speed(fluid: &FluidSpec, radius: Option<f64>, tension: f64, fall: f64) -> f64 {
    let capillary = radius.map_or(0.0, |radius| tension / (fluid.density * radius));
    (TUNING.stiffness * capillary.max(fall)).sqrt()
}

/// Radius of the smallest ball that has the area or volume of a part of a shape; half the length of the waves of a layer; none
/// where the surface of the shape is not known.
pub(super) fn smallest_radius<const D: usize>(shape: &Shape, surface: Option<&ShapeSurface<D>>) -> Option<f64> {
    // Half of a wave, or of the layer where it is flat, stands for the radius.
    if let Shape::Layer { thickness, amplitude, wavelength, .. } = shape {
        return Some(0.5 * wavelength.filter(|_| *amplitude > 0.0).unwrap_or(*thickness));
    }
    let parts = &surface?.parts;
    let radius = |measure: f64| (D - 1) as f64 / ball_curvature::<D>(measure);
    parts.iter().map(|part| radius(part.area_or_volume())).filter(|radius| *radius > 0.0).reduce(f64::min)
}
