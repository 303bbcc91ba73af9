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

/// Relative difference of the drift over the last two fifths of a run up to which it is steady.
const STEADY: f64 = 0.05;

/// The way of a drop's center over a part of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Part<const D: usize> {
    /// Times of the first and the last state; NaN before.
    since: f64,
    until: f64,
    way: Vector<D>,
}

/// The ways of a drop's center over the last two fifths of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Migration<const D: usize> {
    /// End of the run that the fifths are of.
    end: f64,
    /// The center of the last state.
    center: Vector<D>,
    parts: [Part<D>; 2],
}

impl<const D: usize> Migration<D> {
    /// Nothing measured yet of a run to an end.
    pub fn new(end: f64) -> Self {
        let part = Part { since: f64::NAN, until: f64::NAN, way: Vector::<D>::zeros() };
        Self { end, center: Vector::<D>::zeros(), parts: [part; 2] }
    }

    /// Takes the center at a time.
    pub fn take(&mut self, system: &SphSystem<D>, center: &Vector<D>, time: f64) {
        if time < 0.6 * self.end || center.iter().any(|c| !c.is_finite()) {
            return;
        }
        let is_known = !self.parts[0].since.is_nan() || !self.parts[1].since.is_nan();
        let way = if is_known { system.domain.displacement(&self.center, center) } else { Vector::<D>::zeros() };
        let last = self.parts[0].until;
        let part = &mut self.parts[usize::from(time > 0.8 * self.end)];
        if part.since.is_nan() {
            // The second part begins where the first one ends.
            part.since = if last.is_nan() { time } else { last };
        }
        part.way += way;
        part.until = time;
        self.center = *center;
    }

    /// The relative error of the drift against theory, where it holds: of a single circle or sphere in a slope without other forces,
    /// in viscous fluids that started at rest, once it is steady.
    pub fn error(&self, system: &SphSystem<D>, measure: f64) -> Option<ErrorEntry> {
        let config = &system.config;
        let Some(TensionLaw::Slope { slope, is_ball: true, .. }) = config.tension_law else { return None };
        let is_alone = system.droplets.number() == 1 && !system.droplets.has_layer();
        let is_free = config.body_force.is_none() && config.start_velocity == Vector::<D>::zeros() && config.is_at_rest;
        let [before, last] = self.parts.map(|Part { since, until, way }| way / (until - since));
        let is_steady = (last - before).norm() <= STEADY * last.norm();
        let drift = drift_by_slope(config, ball_curvature::<D>(measure));
        if !(is_alone && is_free && is_steady && drift.is_finite()) {
            return None;
        }
        let expected = slope * (-drift * (1.0 - share_of_box(system, measure)));
        let error = (last - expected).norm() / expected.norm();
        let reference =
            "Young, Goldstein and Block 1959 (in the plane likewise), by 1 minus the drop's share of the periodic box";
        Some(entry("migration", "relative", error, self.parts[1].until, reference))
    }

    /// Saves what later reports depend on.
    pub fn save(&self, section: &mut Section) {
        section.put_real("end", self.end);
        section.put_vectors("center", &[self.center]);
        for (name, part) in ["before", "last"].into_iter().zip(&self.parts) {
            section.put_section(name, |section| {
                section.put_optional("since", known(part.since));
                section.put_optional("until", known(part.until));
                section.put_vectors("way", &[part.way]);
            });
        }
    }

    /// The drift of a state that was saved. A run to another end measures its own fifths.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn load(&self, section: &Section) -> Result<Self, LoadError> {
        let part = |section: &Section| {
            Ok::<_, LoadError>(Part {
                since: section.optional("since")?.unwrap_or(f64::NAN),
                until: section.optional("until")?.unwrap_or(f64::NAN),
                way: Vector::<D>::from_column_slice(section.reals_of("way", D)?),
            })
        };
        let saved = Self {
            end: section.real("end")?,
            center: Vector::<D>::from_column_slice(section.reals_of("center", D)?),
            parts: [section.section("before", part)?, section.section("last", part)?],
        };
        Ok(if saved.end.to_bits() == self.end.to_bits() { saved } else { Self::new(self.end) })
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
