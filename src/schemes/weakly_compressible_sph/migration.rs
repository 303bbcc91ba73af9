//! The drift of a drop in a slope of the surface tension.
//!
//! On a sphere with the tension τ₀ (1 + b·x) the slow flow of two fluids moves the drop by −2/3 τ₀ b R/(2η_o + 3η_i) (Young,
//! Goldstein and Block 1959, with the gradient that the interface feels); on a circle by −τ₀ b R/(4 (η_i + η_o)), derived in
//! the same way. The flow outside is that of a potential dipole. In a periodic box without a mean flow, images slow the drop down
//! by 1 − φ to first order in its share φ of the box: the box moves against it by 3/2 φ (2φ in the plane), and the field of the
//! images gives φ/2 (φ) of it back.

use super::config::SphConfig;
use super::droplets::ball_curvature;
use super::system::SphSystem;
use super::tension_law::TensionLaw;
use crate::geometry::Vector;
use crate::geometry::domain::Axis;
use crate::schemes::measured_errors::entry;
use crate::simulation::section::known;
use crate::simulation::{ErrorEntry, LoadError, Section};

/// The way of a drop's center over the last fifth of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Migration<const D: usize> {
    /// Time of the first state, NaN before; times and centers of the last; the way between.
    since: f64,
    time: f64,
    center: Vector<D>,
    way: Vector<D>,
}

impl<const D: usize> Migration<D> {
    /// Nothing measured yet.
    pub fn none() -> Self {
        let (center, way) = (Vector::<D>::zeros(), Vector::<D>::zeros());
        Self { since: f64::NAN, time: f64::NAN, center, way }
    }

    /// Takes the center at a time of a run to an end.
    pub fn take(&mut self, system: &SphSystem<D>, center: &Vector<D>, time: f64, end: f64) {
        if time < 0.8 * end || center.iter().any(|c| !c.is_finite()) {
            return;
        }
        if self.since.is_nan() {
            self.since = time;
        } else {
            self.way += system.domain.displacement(&self.center, center);
        }
        (self.time, self.center) = (time, *center);
    }

    /// The relative error of the drift against theory, where it holds: a single drop in a slope without other forces, in fluids
    /// that started at rest.
    pub fn error(&self, system: &SphSystem<D>, measure: f64) -> Option<ErrorEntry> {
        let config = &system.config;
        let Some(TensionLaw::Slope { slope, .. }) = config.tension_law else { return None };
        let is_alone = system.droplets.number() == 1 && !system.droplets.has_layer();
        let is_free = config.body_force.is_none() && config.start_velocity == Vector::<D>::zeros();
        if !(is_alone && is_free && self.time > self.since) {
            return None;
        }
        let expected =
            slope * (-drift_by_slope(config, ball_curvature::<D>(measure)) * (1.0 - share_of_box(system, measure)));
        let measured = self.way / (self.time - self.since);
        let error = (measured - expected).norm() / expected.norm();
        let reference =
            "Young, Goldstein and Block 1959 (in the plane likewise), by 1 minus the drop's share of the periodic box";
        Some(entry("migration", "relative", error, self.time, reference))
    }

    /// Saves what later reports depend on.
    pub fn save(&self, section: &mut Section) {
        section.put_optional("since", known(self.since));
        section.put_optional("time", known(self.time));
        section.put_vectors("center", &[self.center]);
        section.put_vectors("way", &[self.way]);
    }

    /// The drift of a state that was saved.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn load(section: &Section) -> Result<Self, LoadError> {
        let vector = |name: &str| Ok::<_, LoadError>(Vector::<D>::from_column_slice(section.reals_of(name, D)?));
        Ok(Self {
            since: section.optional("since")?.unwrap_or(f64::NAN),
            time: section.optional("time")?.unwrap_or(f64::NAN),
            center: vector("center")?,
            way: vector("way")?,
        })
    }
}

/// The drift of a drop of a curvature by the slope b, against it.
fn drift_by_slope<const D: usize>(config: &SphConfig<D>, curvature: f64) -> f64 {
    let (inside, outside) = (config.fluids.inside.viscosity, config.fluids.outside.viscosity);
    let strength = config.tension * (D - 1) as f64 / curvature;
    if D == 2 { 0.25 * strength / (inside + outside) } else { 2.0 / 3.0 * strength / (2.0 * outside + 3.0 * inside) }
}

/// The share of the box that the drops fill.
fn share_of_box<const D: usize>(system: &SphSystem<D>, measure: f64) -> f64 {
    let lengths = system.domain.axes().iter().map(|axis| match axis {
        Axis::Unbounded => f64::INFINITY,
        Axis::Periodic { length, .. } => *length,
    });
    measure / lengths.product::<f64>()
}
