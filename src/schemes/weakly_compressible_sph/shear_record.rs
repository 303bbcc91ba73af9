//! What a series shows of a box in shear: its stress, how far it was sheared, and how much the drop is drawn out.

use super::droplets::ball_curvature;
use super::monitors::semi_axes;
use super::quantities::{SHEAR_STRESS, STRAIN, TAYLOR_DEFORMATION};
use super::species::Species;
use super::system::SphSystem;
use crate::closest_point::enclosed_moments::EnclosedMoments;
use crate::geometry::Vector;
use crate::schemes::measured_errors::entry;
use crate::simulation::section::known;
use crate::simulation::{Component, ErrorEntry, LoadError, Quantity, Section};

static QUANTITIES: [&Quantity; 3] = [&SHEAR_STRESS, &STRAIN, &TAYLOR_DEFORMATION];

/// The numbers of the last row; NaN where there is nothing to measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ShearRecord {
    values: [f64; QUANTITIES.len()],
}

impl ShearRecord {
    /// Nothing measured yet.
    pub const UNKNOWN: Self = Self { values: [f64::NAN; QUANTITIES.len()] };

    /// Takes a state.
    pub fn take<const D: usize>(&mut self, system: &SphSystem<D>, moments: Option<&EnclosedMoments<D>>, time: f64) {
        let rate = system.config.mean_shear.map_or(f64::NAN, |shear| shear.rate);
        let moments = moments.filter(|_| system.droplets.number() == 1 && !system.droplets.has_layer());
        let drawn_out = moments.map_or(f64::NAN, |moments| {
            let [longest, shortest] = semi_axes(moments);
            (longest - shortest) / (longest + shortest)
        });
        // A strain of −0 is 0.
        self.values = [system.shear_stress().unwrap_or(f64::NAN), rate * time + 0.0, drawn_out];
    }

    /// The quantities with their values.
    pub fn observables(&self) -> impl Iterator<Item = (&'static Quantity, f64)> + '_ {
        QUANTITIES.into_iter().zip(self.values)
    }

    /// Stress and deformation at the end, and their relative errors where they are known: of fluids of one viscosity without tension that
    /// started with the mean flow, and of a single drop of a small capillary number in a slow flow once it is steady (Taylor 1932, 1934).
    pub fn errors<const D: usize>(&self, system: &SphSystem<D>, time: f64) -> Vec<ErrorEntry> {
        let Some(shear) = system.config.mean_shear else { return Vec::new() };
        let [stress, _, deformation] = self.values;
        let mut errors = Vec::new();
        let mut add = |quantity, norm, value: f64, reference| {
            errors.extend(value.is_finite().then(|| entry(quantity, norm, value, time, reference)));
        };
        add("shear_stress", "mean", stress, "no error: the stress of the box at the end");
        let is_mean = system.config.is_at_rest && system.config.start_velocity == Vector::<D>::zeros();
        let viscosity = viscosity_alone(system).filter(|_| is_mean);
        let expected = viscosity.map_or(f64::NAN, |viscosity| viscosity * shear.rate);
        add("shear_stress", "relative", (stress / expected - 1.0).abs(), "viscosity times shear rate");
        add("taylor_deformation", "mean", deformation, "no error: the deformation of the drop at the end");
        let reference = "Taylor 1934 (in the plane likewise): a drop alone, to first order in the capillary number";
        let expected = small_deformation(system, time).unwrap_or(f64::NAN);
        add("taylor_deformation", "relative", (deformation / expected - 1.0).abs(), reference);
        errors
    }
}

/// The viscosity of all fluids in the box; None where there are two, or an interface that adds to the stress.
fn viscosity_alone<const D: usize>(system: &SphSystem<D>) -> Option<f64> {
    let (config, species) = (&system.config, &system.flow.species);
    let is_one = species.windows(2).all(|pair| pair[0] == pair[1]);
    match species.first()? {
        _ if !is_one && (config.has_tension() || !config.fluids.have_one_viscosity()) => None,
        Species::Inside => Some(config.fluids.inside.viscosity),
        Species::Outside => Some(config.fluids.outside.viscosity),
    }
}

/// (L − B)/(L + B) of a drop alone in a slow shear, Ca (19λ + 16)/(16λ + 16) with Ca = ηγR/τ and λ the viscosity of the drop by that
/// around it; in the plane Ca, whatever λ (the same expansion, with the flow r cos 2θ of the strain). None where that does not hold: beyond
/// the first order, with inertia, and before the drop is steady (after four times ηR/τ (19λ + 16)(2λ + 3)/(40 (λ + 1))).
fn small_deformation<const D: usize>(system: &SphSystem<D>, time: f64) -> Option<f64> {
    /// Largest capillary number and Reynolds number ργR²/η of the theory, and times of relaxation after which a drop is steady.
    const BOUNDS: [f64; 3] = [0.15, 0.5, 4.0];
    let config = &system.config;
    let (inside, outside) = (&config.fluids.inside, &config.fluids.outside);
    let radius = (D - 1) as f64 / ball_curvature::<D>(system.droplets.initial_measure);
    let rate = config.mean_shear?.rate.abs();
    let capillary = outside.viscosity * rate * radius / config.tension;
    let reynolds = outside.density.max(inside.density) * rate * radius * radius / outside.viscosity;
    let ratio = inside.viscosity / outside.viscosity;
    let relaxation = outside.viscosity * radius / config.tension * (19.0 * ratio + 16.0) * (2.0 * ratio + 3.0)
        / (40.0 * (ratio + 1.0));
    let holds = capillary <= BOUNDS[0] && reynolds <= BOUNDS[1] && time >= BOUNDS[2] * relaxation;
    let drawn = if D == 2 { 1.0 } else { (19.0 * ratio + 16.0) / (16.0 * ratio + 16.0) };
    holds.then_some(capillary * drawn)
}

impl Component for ShearRecord {
    fn save(&self, section: &mut Section) {
        for (quantity, value) in self.observables() {
            section.put_optional(quantity.name, known(value));
        }
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        let mut values = [f64::NAN; QUANTITIES.len()];
        for (value, quantity) in values.iter_mut().zip(QUANTITIES) {
            *value = section.optional(quantity.name)?.unwrap_or(f64::NAN);
        }
        Ok(Self { values })
    }
}
