//! What a series shows of two fluids, and what a report makes of it.

use super::budget::Contents;
use super::quantities;
use super::smoothed_delta::{smoothed_delta, smoothed_step};
use super::species::Species;
use super::system::SphSystem;
use super::walls::Container;
use crate::closest_point::enclosed_moments::{Bounds, EnclosedMoments, Space, enclosed_moments};
use crate::geometry::Vector;
use crate::geometry::domain::Axis;
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::Interrupted;
use crate::simulation::section::known;
use crate::simulation::{LoadError, Quantity, Section};
use nalgebra::Matrix3;
use std::f64::consts::PI;

/// Numbers of one state, in the order of [`names`].
pub(super) type Row = Vec<f64>;

/// The quantities of a row: the columns of a series behind time and time step.
pub(super) fn names(dimension: usize) -> Vec<&'static Quantity> {
    let axes = |three: [&'static Quantity; 3]| three.into_iter().take(dimension);
    let mut names = vec![&quantities::KINETIC_ENERGY];
    names.extend(axes([&quantities::MOMENTUM_X, &quantities::MOMENTUM_Y, &quantities::MOMENTUM_Z]));
    let measure = if dimension == 2 { &quantities::AREA } else { &quantities::VOLUME };
    names.extend([&quantities::CURVATURE_MEAN, &quantities::CURVATURE_STD, measure]);
    names.extend(axes([&quantities::CENTER_X, &quantities::CENTER_Y, &quantities::CENTER_Z]));
    names.extend(axes([&quantities::EXTENT_X, &quantities::EXTENT_Y, &quantities::EXTENT_Z]));
    names.extend([
        &quantities::DEFORMATION,
        &quantities::PRESSURE_INSIDE,
        &quantities::PRESSURE_OUTSIDE,
        &quantities::PRESSURE_EOS_JUMP,
        &quantities::DROPLETS,
        &quantities::MACH,
        &quantities::CFL,
        &quantities::LEAST_PAIR_DISTANCE_H,
        &quantities::SPEED_MAX,
        if dimension == 2 { &quantities::PERIMETER } else { &quantities::SURFACE_AREA },
        &quantities::SURFACE_ENERGY,
        &quantities::ELASTIC_ENERGY,
        &quantities::WORK,
        &quantities::ELONGATION,
    ]);
    names.extend((dimension == 2).then_some(&quantities::ELONGATION_ANGLE));
    names.push(&quantities::CIRCULARITY);
    if dimension == 2 {
        names.extend([&quantities::MODE_2, &quantities::MODE_3, &quantities::MODE_4]);
    }
    names.extend([
        &quantities::PRESSURE_JUMP_MEASURED,
        &quantities::PRESSURE_BALANCED,
        &quantities::PRESSURE_INSIDE_COUNT,
    ]);
    names
}

/// Numbers of a row in version 0.1, whose checkpoints have the first of [`names`] alone.
pub(super) fn names_of_version_0_1(dimension: usize) -> usize {
    12 + 3 * dimension
}

/// Saves a row by the names of its quantities; what is not known is left open.
pub(super) fn save_row<const D: usize>(row: &Row, section: &mut Section) {
    for (quantity, value) in names(D).into_iter().zip(row) {
        section.put_optional(quantity.name, known(*value));
    }
}

/// The row of a state.
///
/// # Errors
/// [`LoadError`] where a number is missing.
pub(super) fn load_row<const D: usize>(section: &Section) -> Result<Row, LoadError> {
    let known_before = names_of_version_0_1(D);
    let value = |(k, quantity): (usize, &'static Quantity)| match k < known_before || section.has(quantity.name) {
        true => Ok(section.optional(quantity.name)?.unwrap_or(f64::NAN)),
        // Version 0.2.0 did not measure it.
        false => Ok(f64::NAN),
    };
    names(D).into_iter().enumerate().map(value).collect()
}

/// Mean and standard deviation.
fn spread(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let (count, sum) = values.clone().fold((0.0, 0.0), |(count, sum), v| (count + 1.0, sum + v));
    let mean: f64 = sum / count;
    let square: f64 = values.map(|v| (v - mean) * (v - mean)).sum();
    (mean, (square / count).sqrt())
}

impl<const D: usize> SphSystem<D> {
    /// Mean and standard deviation of the curvature over the particles that feel the tension: |φ| < 2 ε, or those of the
    /// color field's interface. Fragments are left out: a few particles have no curvature that they resolve.
    fn curvature_spread(&self) -> (f64, f64) {
        let curvature = self.particles.scalar(self.columns.curvature);
        let band = self.particles.flag(self.columns.in_band);
        let phi = self.particles.scalar(self.columns.phi);
        let width =
            if self.interface.level_set().is_some() { 2.0 * self.config.smoothing_length } else { f64::INFINITY };
        let counts = |i: &usize| band[*i] == 1 && phi[*i].abs() < width && !self.droplets.is_fragment(*i);
        spread((0..band.len()).filter(counts).map(|i| curvature[i]))
    }

    /// Area or volume, center and second moments of the inside, by quadrature on the fits; None without an interface.
    pub(super) fn moments(&self) -> Result<Option<EnclosedMoments<D>>, Interrupted> {
        let Some(interface) = self.interface.level_set() else { return Ok(None) };
        let center = self.circular_center(&interface.surface.sample_points());
        let unwrap = |x: &Vector<D>| center + self.domain.displacement(&center, x);
        let container = self.config.container.as_ref();
        let from_bodies = |x: &Vector<D>| {
            let beside = container.and_then(|container| container.beside_obstacle(x));
            beside.map_or((f64::INFINITY, Vector::<D>::zeros()), |beside| (beside.distance, beside.normal))
        };
        let space = Space {
            bounds: container.map_or_else(Bounds::none, Container::bounds),
            inside: container
                .filter(|_| self.droplets.has_contact())
                .map(|container| self.box_between_walls(container)),
            bodies: container.filter(|container| container.has_obstacles()).map(|_| &from_bodies as _),
        };
        enclosed_moments(&interface.surface, unwrap, &space, &self.interrupt).map(Some)
    }

    /// A box around the particles inside, along axes with walls; empty along the others.
    fn box_between_walls(&self, container: &Container<D>) -> Bounds<D> {
        let (mut low, mut high) = (Vector::<D>::repeat(f64::INFINITY), Vector::<D>::repeat(f64::NEG_INFINITY));
        let inside = self.flow.species.iter().zip(self.particles.positions());
        for (_, x) in inside.filter(|(species, _)| **species == Species::Inside) {
            for d in (0..D).filter(|d| container.is_bounded(*d)) {
                low[d] = low[d].min(x[d]);
                high[d] = high[d].max(x[d]);
            }
        }
        Bounds { low, high }
    }

    /// A center from which nothing is cut: along periodic axes opposite to the widest gap between points.
    fn circular_center(&self, points: &[Vector<D>]) -> Vector<D> {
        let mut center = Vector::<D>::zeros();
        let mut points = points.to_vec();
        // x comes last: in a box in shear images along another axis are displaced along it.
        for d in (0..D).rev() {
            center[d] = self.circular_center_along(d, points.iter().map(|x| x[d]));
            if let Some(tilt) = self.domain.tilt().filter(|tilt| tilt.axis == d) {
                for x in &mut points {
                    x[0] -= ((x[d] - center[d]) / self.domain.length(d)).round() * tilt.offset;
                    x[0] = self.domain.wrap(*x)[0];
                }
            }
        }
        center
    }

    fn circular_center_along(&self, d: usize, places: impl ExactSizeIterator<Item = f64>) -> f64 {
        match self.domain.axes()[d] {
            Axis::Unbounded => {
                let count = places.len().max(1) as f64;
                places.sum::<f64>() / count
            }
            Axis::Periodic { start, length } => {
                let mut places: Vec<f64> = places.collect();
                places.sort_by(f64::total_cmp);
                let last = places.last().map_or(start, |last| last - length);
                let before = std::iter::once(last).chain(places.iter().copied());
                let gaps = before.zip(&places).map(|(from, to)| (to - from, 0.5 * (from + to)));
                let (_, middle) = gaps.fold((0.0, start), |most, gap| if gap.0 > most.0 { gap } else { most });
                start + (middle + 0.5 * length - start).rem_euclid(length)
            }
        }
    }

    /// The least distance of two particles, in h, and the share of particles that have another closer than `crowded`, in h.
    fn pair_distances(&self, crowded: f64) -> (f64, f64) {
        let positions = self.particles.positions();
        let mut cells = CellList::new(self.domain.clone());
        let reach = self.config.spacing;
        cells.rebuild(positions.iter().copied(), reach);
        let mut least = reach * reach;
        let limit = (crowded * reach) * (crowded * reach);
        let mut close = 0_usize;
        for (i, x) in positions.iter().enumerate() {
            let mut nearest = f64::INFINITY;
            cells.for_each_within(x, reach, |j, _, r2| {
                if j != i {
                    nearest = nearest.min(r2);
                }
            });
            least = least.min(nearest);
            close += usize::from(nearest < limit);
        }
        (least.sqrt() / self.config.spacing, close as f64 / positions.len() as f64)
    }

    /// Everything a row of the series shows, and the share of particles that are closer than `crowded`, in h.
    pub(super) fn row(
        &self,
        time_step: f64,
        moments: Option<&EnclosedMoments<D>>,
        (contents, work): (&Contents<D>, f64),
        crowded: f64,
    ) -> (Row, f64) {
        let mut row = vec![contents.kinetic];
        row.extend(contents.momentum.iter());
        let (mean, deviation) = self.curvature_spread();
        row.extend([mean, deviation]);
        let nothing = Vector::<D>::repeat(f64::NAN);
        row.push(self.enclosed_measure(moments));
        // A layer has neither a center nor extents.
        let moments = moments.filter(|_| !self.droplets.has_layer());
        row.extend(moments.map_or(nothing, EnclosedMoments::center).iter());
        row.extend(moments.map_or(nothing, |m| m.high - m.low).iter());
        row.push(moments.map_or(f64::NAN, deformation));
        let pressures = self.pressures(moments);
        let droplets = if self.config.has_tension() { self.droplets.number() as f64 } else { f64::NAN };
        let speed = self.flow.largest_speed();
        let sound = self.config.fluids.least_sound_speed();
        row.extend([pressures.inside, pressures.outside, pressures.eos_jump, droplets, speed / sound]);
        let (least, close) = self.pair_distances(crowded);
        row.extend([speed * time_step / self.config.spacing, least, speed, contents.interface]);
        row.extend([contents.surface, contents.elastic, work]);
        let (elongation, angle) = moments.map_or((f64::NAN, f64::NAN), elongation);
        row.push(elongation);
        row.extend((D == 2).then_some(angle));
        row.push(moments.map_or(f64::NAN, |m| circularity::<D>(m.area_or_volume, contents.interface)));
        if D == 2 {
            row.extend(self.modes(moments));
        }
        row.extend([pressures.measured_jump, pressures.balanced, pressures.inside_count]);
        (row, close)
    }

    /// Sum of the volumes of the particles inside, where there is no level set to measure by.
    pub(super) fn volume_inside(&self) -> f64 {
        let inside = (0..self.flow.count()).filter(|i| self.flow.species[*i] == Species::Inside);
        inside.map(|i| self.flow.volume[i]).sum()
    }

    /// Area or volume inside: by quadrature on the fits, of a layer by a smoothed sum over the particles.
    pub(super) fn enclosed_measure(&self, moments: Option<&EnclosedMoments<D>>) -> f64 {
        if !self.droplets.has_layer() || self.interface.level_set().is_none() {
            return moments.map_or(f64::NAN, |m| m.area_or_volume);
        }
        let (phi, band) = (self.particles.scalar(self.columns.phi), self.particles.flag(self.columns.in_band));
        let share = |i: usize| match self.flow.species[i] {
            _ if band[i] == 1 => smoothed_step(-phi[i], self.config.smoothing_length),
            species => species.color(),
        };
        (0..phi.len()).map(|i| self.flow.volume[i] * share(i)).sum()
    }

    /// Sizes of the modes 2 to 4 of the distance from the centroid over the angle, by its mean: |∮ r e^{inθ} dθ|/∮ r dθ times 2,
    /// with dθ = (r·n)/r² V δ at the foot points. Only of a single drop in the plane.
    fn modes(&self, moments: Option<&EnclosedMoments<D>>) -> [f64; 3] {
        let (Some(moments), Some(level_set)) = (moments, self.interface.level_set()) else { return [f64::NAN; 3] };
        if self.droplets.number() != 1 {
            return [f64::NAN; 3];
        }
        let (particles, columns) = (&self.particles, &self.columns);
        let (phi, band) = (particles.scalar(columns.phi), particles.flag(columns.in_band));
        let (foot, normal) = (particles.vector(columns.closest_point), particles.vector(columns.normal));
        let center = self.domain.wrap(moments.center());
        let mut sums = [[0.0; 2]; 4];
        for i in level_set.candidates().iter().copied().filter(|i| band[*i] == 1) {
            let r = self.domain.displacement(&center, &foot[i]);
            let square = r.norm_squared();
            let length = self.flow.volume[i] * smoothed_delta(phi[i], self.config.smoothing_length);
            let angle = r[1].atan2(r[0]);
            // r dθ
            let share = r.dot(&normal[i]) / square * length * square.sqrt();
            for (sum, n) in sums.iter_mut().zip([0.0, 2.0, 3.0, 4.0]) {
                sum[0] += share * (n * angle).cos();
                sum[1] += share * (n * angle).sin();
            }
        }
        std::array::from_fn(|k| 2.0 * sums[k + 1][0].hypot(sums[k + 1][1]) / sums[0][0])
    }
}

/// (a − b)/(a + b) of the largest and the least eigenvalue of the central second moments, and the angle of the longest axis
/// with x.
fn elongation<const D: usize>(moments: &EnclosedMoments<D>) -> (f64, f64) {
    let covariance = moments.covariance();
    if D == 2 {
        let (mean, half) =
            (0.5 * (covariance[(0, 0)] + covariance[(1, 1)]), 0.5 * (covariance[(0, 0)] - covariance[(1, 1)]));
        let mixed = covariance[(0, 1)];
        return (half.hypot(mixed) / mean, 0.5 * mixed.atan2(half));
    }
    let (least, most) = extreme_moments(moments);
    ((most - least) / (most + least), f64::NAN)
}

/// Lengths by which the longest and the shortest axis of a drop stand to each other: roots of the eigenvalues of its second moments.
pub(super) fn semi_axes<const D: usize>(moments: &EnclosedMoments<D>) -> [f64; 2] {
    let (least, most) = extreme_moments(moments);
    [most.sqrt(), least.sqrt()]
}

/// The least and the largest eigenvalue of the central second moments.
fn extreme_moments<const D: usize>(moments: &EnclosedMoments<D>) -> (f64, f64) {
    let covariance = moments.covariance();
    if D == 2 {
        let mean = 0.5 * (covariance[(0, 0)] + covariance[(1, 1)]);
        let half = (0.5 * (covariance[(0, 0)] - covariance[(1, 1)])).hypot(covariance[(0, 1)]);
        return (mean - half, mean + half);
    }
    let full = Matrix3::from_fn(|d, e| covariance[(d.min(D - 1), e.min(D - 1))]);
    let values = full.symmetric_eigenvalues();
    (values.min(), values.max())
}

/// Perimeter of the disk of the same area by that of the interface, in space the area of the ball of the same volume.
fn circularity<const D: usize>(measure: f64, interface: f64) -> f64 {
    let ball = if D == 2 { 2.0 * (PI * measure).sqrt() } else { (36.0 * PI * measure * measure).cbrt() };
    ball / interface
}

/// (Qxx − Qyy)/(Qxx + Qyy) of the central second moments; in space with the mean of Qyy and Qzz for Qyy.
pub(super) fn deformation<const D: usize>(moments: &EnclosedMoments<D>) -> f64 {
    let variance = moments.variance();
    let across = variance.iter().skip(1).sum::<f64>() / (D - 1) as f64;
    (variance[0] - across) / (variance[0] + across)
}
