//! What a series shows of drops between walls: how they rise, and how they meet the walls.

use super::interactions::contact_line::AtLine;
use super::interactions::{BodyForce, Moment};
use super::quantities::{CONTACT_ANGLE, CONTACT_HIGH, CONTACT_LOW, RISE_HEIGHT, RISE_VELOCITY, WETTED};
use super::smoothed_delta::smoothed_step;
use super::species::Species;
use super::system::SphSystem;
use super::walls::Container;
use crate::closest_point::enclosed_moments::Bounds;
use crate::geometry::Vector;
use crate::neighbors::{CellList, NeighborSearch};
use crate::schemes::measured_errors::entry;
use crate::simulation::section::known;
use crate::simulation::{Component, ErrorEntry, LoadError, Quantity, Section};
use std::f64::consts::PI;

/// The numbers of the last row, and extremes of the run; NaN where there is nothing to measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WallRecord {
    values: [f64; QUANTITIES.len()],
    fastest_rise: f64,
    least_circularity: f64,
    largest_speed: f64,
}

static QUANTITIES: [&Quantity; 6] =
    [&RISE_VELOCITY, &RISE_HEIGHT, &WETTED, &CONTACT_ANGLE, &CONTACT_LOW, &CONTACT_HIGH];

/// Sums over the particles next to contact lines.
#[derive(Debug, Default)]
struct LineSums {
    length: f64,
    cosine: f64,
    /// Lengths of the parts that face −x and +x, and their places times these.
    sides: [(f64, f64); 2],
}

impl WallRecord {
    /// Nothing measured yet.
    pub const UNKNOWN: Self = Self {
        values: [f64::NAN; QUANTITIES.len()],
        fastest_rise: f64::NAN,
        least_circularity: f64::NAN,
        largest_speed: f64::NAN,
    };

    /// Takes a state.
    pub fn take<const D: usize>(&mut self, system: &SphSystem<D>, moment: &Moment<'_, D>, circularity: f64) {
        let (rise, height) = rise(system).unwrap_or((f64::NAN, f64::NAN));
        // The other number where one is not known.
        self.fastest_rise = self.fastest_rise.max(rise);
        self.least_circularity = self.least_circularity.min(circularity);
        self.largest_speed = self.largest_speed.max(system.flow.largest_speed());
        let nothing = [f64::NAN; 4];
        let [wetted, angle, low, high] = system.contact_lines.as_ref().map_or(nothing, |_| contacts(system, moment));
        self.values = [rise, height, wetted, angle, low, high];
    }

    /// The quantities with their values.
    pub fn observables(&self) -> impl Iterator<Item = (&'static Quantity, f64)> + '_ {
        QUANTITIES.into_iter().zip(self.values)
    }

    /// The difference of the contact angle from that of the walls where they have one, that of the flow from the steady one, and that of
    /// the pressure from ρgh.
    pub fn errors<const D: usize>(&self, system: &SphSystem<D>, time: f64) -> Vec<ErrorEntry> {
        let mut errors = Vec::new();
        let mut add = |quantity, norm, value: f64, reference| {
            errors.extend(value.is_finite().then(|| entry(quantity, norm, value, time, reference)));
        };
        let walls = || system.config.container.iter().flat_map(Container::walls);
        // Between two angles a line may rest anywhere.
        let angle = system.droplets.contact_angle().filter(|_| !walls().any(|wall| wall.contact.has_hysteresis()));
        if let Some(expected) = angle.map(f64::to_degrees) {
            let reference = "the contact angle of the wall, in degrees";
            let [_, _, _, angle, ..] = self.values;
            add("contact_angle", "max", (angle - expected).abs(), reference);
            let reference = "the width between the contact lines of the cap of the area at the start";
            add("contact_width", "relative", self.width_error(system, expected), reference);
        }
        add("rise_velocity", "max", self.fastest_rise, "no error: the largest of the run");
        add("rise_height", "mean", self.values[1], "no error: the center of the fluid inside");
        if self.fastest_rise.is_finite() {
            add("circularity", "least", self.least_circularity, "no error: the least of the run");
        }
        if let Some(fall) = fall_speed(system) {
            add("speed", "by_gravity", self.largest_speed / fall, "sqrt(g H) of the height between the walls");
        }
        if let Some(steady) = &system.config.steady_flow {
            let error = steady.error(system.particles.positions(), &system.flow.velocity);
            add("velocity", "relative", error, "the steady flow between the walls, by its largest speed");
        }
        if let Some([largest, rms]) = hydrostatic_errors(system) {
            let reference = "p = rho g h of layers at rest, by its largest difference";
            add("pressure", "max", largest, reference);
            add("pressure", "rms", rms, reference);
        }
        errors
    }

    /// Relative error of the width between the contact lines, in the plane.
    fn width_error<const D: usize>(&self, system: &SphSystem<D>, angle: f64) -> f64 {
        let [.., low, high] = self.values;
        let [kappa] = system.droplets.ball_curvatures[..] else { return f64::NAN };
        // On a body the drop is no cap of a flat wall.
        if system.config.container.as_ref().is_some_and(Container::has_obstacles) {
            return f64::NAN;
        }
        let width = 2.0 * angle.to_radians().sin() / kappa;
        ((high - low) / width - 1.0).abs()
    }
}

/// Largest and root mean square difference of the pressure from ρgh, by its largest difference. Only of layers across a gravity that
/// walls hold.
///
/// Differences are means over the kernel. Where densities jump the pressures of rows alternate by some per cent, which no force feels.
fn hydrostatic_errors<const D: usize>(system: &SphSystem<D>) -> Option<[f64; 2]> {
    let (config, container) = (&system.config, system.config.container.as_ref()?);
    let Some(BodyForce::Constant(gravity)) = config.body_force else { return None };
    let axis = (0..D).find(|d| container.is_bounded(*d) && gravity[*d] != 0.0)?;
    let is_alone = (0..D).all(|d| d == axis || gravity[d] == 0.0);
    if !is_alone || !config.starts_in_layers {
        return None;
    }
    let flow = &system.flow;
    // Particles by height, and the weight of what lies below each.
    let mut order: Vec<usize> = (0..flow.count()).collect();
    let positions = system.particles.positions();
    order.sort_by(|a, b| positions[*a][axis].total_cmp(&positions[*b][axis]));
    let bounds = container.bounds();
    let length = bounds.high[axis] - bounds.low[axis];
    let section = flow.cell * flow.count() as f64 / length;
    let mut below = 0.0;
    let mut differences = vec![0.0; order.len()];
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for rows in order.chunk_by(|a, b| (positions[*a][axis] - positions[*b][axis]).abs() < 0.2 * config.spacing) {
        let weight: f64 = rows.iter().map(|i| flow.mass(*i)).sum::<f64>() * gravity[axis] / section;
        // A row lies in the middle of its own weight.
        let expected = below + 0.5 * weight;
        (least, most) = (least.min(expected), most.max(expected));
        rows.iter().for_each(|i| differences[*i] = flow.pressure[*i] - expected);
        below += weight;
    }
    let differences = means_over_kernel(system, &differences);
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    let largest = differences.iter().map(|d| (d - mean).abs()).fold(0.0, f64::max);
    let squares = differences.iter().map(|d| (d - mean) * (d - mean)).sum::<f64>() / differences.len() as f64;
    Some([largest / (most - least), squares.sqrt() / (most - least)])
}

/// Means of a function of the particles with weights (1 − q)⁴ (1 + 4q) within the kernel's support.
fn means_over_kernel<const D: usize>(system: &SphSystem<D>, values: &[f64]) -> Vec<f64> {
    let radius = system.config.kernel.support() * system.config.smoothing_length;
    let mut cells = CellList::new(system.domain.clone());
    let positions = system.particles.positions();
    cells.rebuild(positions.iter().copied(), radius);
    let mean = |x: &Vector<D>| {
        let (mut all, mut sum) = (0.0, 0.0);
        cells.for_each_within(x, radius, |j, _, square| {
            let q: f64 = square.sqrt() / radius;
            let weight = (1.0 - q).powi(4) * (1.0 + 4.0 * q);
            all += weight;
            sum += weight * values[j];
        });
        sum / all
    };
    positions.iter().map(mean).collect()
}

/// √(gH) of a constant body force across walls.
fn fall_speed<const D: usize>(system: &SphSystem<D>) -> Option<f64> {
    let (force, container) = (system.config.body_force.as_ref()?, system.config.container.as_ref()?);
    let down = force.constant_direction()?;
    let Bounds { low, high } = container.bounds();
    let height: f64 = (0..D).filter(|d| container.is_bounded(*d)).map(|d| down[d].abs() * (high[d] - low[d])).sum();
    (height > 0.0).then(|| (force.constant_strength() * height).sqrt())
}

/// Mean velocity and place of the fluid inside against a constant body force; no place where it is not between walls.
fn rise<const D: usize>(system: &SphSystem<D>) -> Option<(f64, f64)> {
    let down = system.config.body_force.as_ref()?.constant_direction()?;
    let container = system.config.container.as_ref();
    let is_between = (0..D).all(|d| down[d] == 0.0 || container.is_some_and(|container| container.is_bounded(d)));
    let (flow, positions) = (&system.flow, system.particles.positions());
    let (mut volume, mut velocity, mut height) = (0.0, 0.0, 0.0);
    for i in (0..flow.count()).filter(|i| flow.species[*i] == Species::Inside) {
        volume += flow.volume[i];
        velocity -= flow.volume[i] * flow.velocity[i].dot(&down);
        height -= flow.volume[i] * positions[i].dot(&down);
    }
    Some((velocity / volume, if is_between { height / volume } else { f64::NAN }))
}

/// The wetted length or area, the mean contact angle in degrees, and in the plane the places of the contact lines along x.
fn contacts<const D: usize>(system: &SphSystem<D>, moment: &Moment<'_, D>) -> [f64; 4] {
    let Some(lines) = &system.contact_lines else { return [f64::NAN; 4] };
    let mut sums = LineSums::default();
    for AtLine { particle, cosine, along, height, .. } in lines.particles(moment) {
        let length = system.flow.volume[particle] * along.norm();
        sums.length += length;
        sums.cosine += length * cosine;
        let foot = system.particles.vector(system.columns.closest_point)[particle];
        let way = way_along_wall((cosine, height), system.droplets.ball_curvature(particle) / (D - 1) as f64);
        let direction = along / along.norm().max(f64::MIN_POSITIVE);
        let (weight, place) = &mut sums.sides[usize::from(along[0] > 0.0)];
        *weight += length;
        *place += length * (foot + direction * way)[0];
    }
    let wetted = system.wetted_area(|_| 1.0);
    if sums.length <= 0.0 {
        return [wetted, f64::NAN, f64::NAN, f64::NAN];
    }
    let angle = (sums.cosine / sums.length).clamp(-1.0, 1.0).acos() * 180.0 / PI;
    let place = |(weight, place): (f64, f64)| if D == 2 && weight > 0.0 { place / weight } else { f64::NAN };
    [wetted, angle, place(sums.sides[0]), place(sums.sides[1])]
}

/// How far a line at a wall lies outwards of a place of the interface at a height, for the angle at the wall and a curvature.
fn way_along_wall((cosine, height): (f64, f64), curvature: f64) -> f64 {
    let sine = |cosine: f64| (1.0 - cosine * cosine).max(0.0).sqrt();
    let above = cosine + height * curvature;
    // Of a circle the sines differ by the way over the radius; of a plane the way is the height by the tangent.
    if curvature.abs() * height.abs() < 1e-6 {
        return height * cosine / sine(cosine).max(1e-3);
    }
    (sine(cosine) - sine(above)) / curvature
}

impl<const D: usize> SphSystem<D> {
    /// How deep in a wall the deepest particle is, in h.
    pub(super) fn depth_in_walls(&self) -> Option<f64> {
        Some(self.walls.as_ref()?.depth(self.particles.positions()) / self.config.spacing)
    }

    /// The length or area of the walls that the fluid inside covers, Σ V δ_w(s) H(−φ), each wall times a factor.
    pub(super) fn wetted_area(&self, factor: impl Fn(usize) -> f64) -> f64 {
        let (Some(lines), Some(container)) = (&self.contact_lines, &self.config.container) else { return 0.0 };
        let (phi, band) = (self.particles.scalar(self.columns.phi), self.particles.flag(self.columns.in_band));
        let normal = self.particles.vector(self.columns.normal);
        let mut area = 0.0;
        for (i, x) in self.particles.positions().iter().enumerate() {
            let Some(beside) = container.beside(x) else { break };
            let profile = lines.wall_profile(beside.distance);
            if profile <= 0.0 {
                continue;
            }
            let share = match self.flow.species[i] {
                // The distance of its foot on the wall from the interface.
                _ if band[i] == 1 => {
                    let at_wall = phi[i] + beside.distance * normal[i].dot(&beside.normal);
                    smoothed_step(-at_wall, self.config.smoothing_length)
                }
                species => species.color(),
            };
            if share > 0.0 {
                area += factor(beside.wall) * self.flow.volume[i] * share * profile;
            }
        }
        area
    }

    /// The energy −τ cos θ_e by area of the walls that the fluid inside covers.
    pub(super) fn wetting_energy(&self) -> f64 {
        let Some(container) = &self.config.container else { return 0.0 };
        -self.config.tension * self.wetted_area(|wall| container.wall(wall).contact.mean().cos())
    }

    /// The momentum by time that walls give to drops which touch them, through surface tension.
    pub(super) fn held_by_walls(&self) -> Vector<D> {
        let of_band = self.band.forces.iter().filter(|(i, _)| self.droplets.is_at_wall(*i));
        of_band.chain(&self.line_forces).map(|(i, a)| a * self.flow.mass(*i)).sum()
    }
}

impl Component for WallRecord {
    fn save(&self, section: &mut Section) {
        for (quantity, value) in self.observables() {
            section.put_optional(quantity.name, known(value));
        }
        section.put_optional("fastest_rise", known(self.fastest_rise));
        section.put_optional("least_circularity", known(self.least_circularity));
        section.put_optional("largest_speed", known(self.largest_speed));
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        let mut values = [f64::NAN; QUANTITIES.len()];
        for (value, quantity) in values.iter_mut().zip(QUANTITIES) {
            *value = section.optional(quantity.name)?.unwrap_or(f64::NAN);
        }
        let value = |name: &str| Ok::<f64, LoadError>(section.optional(name)?.unwrap_or(f64::NAN));
        Ok(Self {
            values,
            fastest_rise: value("fastest_rise")?,
            least_circularity: value("least_circularity")?,
            largest_speed: value("largest_speed")?,
        })
    }
}
