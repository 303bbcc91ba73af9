//! What a series shows of two fluids, and what a report makes of it.

use super::quantities;
use super::species::Species;
use super::system::SphSystem;
use crate::closest_point::enclosed_moments::{EnclosedMoments, enclosed_moments};
use crate::geometry::Vector;
use crate::geometry::domain::Axis;
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::Interrupted;
use crate::simulation::section::known;
use crate::simulation::{LoadError, Quantity, Section};

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
    ]);
    names
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
    names(D).into_iter().map(|quantity| Ok(section.optional(quantity.name)?.unwrap_or(f64::NAN))).collect()
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
    /// color field's interface.
    fn curvature_spread(&self) -> (f64, f64) {
        let curvature = self.particles.scalar(self.columns.curvature);
        let band = self.particles.flag(self.columns.in_band);
        let phi = self.particles.scalar(self.columns.phi);
        let width =
            if self.interface.level_set().is_some() { 2.0 * self.config.smoothing_length } else { f64::INFINITY };
        spread((0..band.len()).filter(|i| band[*i] == 1 && phi[*i].abs() < width).map(|i| curvature[i]))
    }

    /// Means of the pressure well inside and well outside: by the equation of state, and with what the balanced force has
    /// absorbed inside.
    fn mean_pressures(&self) -> [(f64, f64); 2] {
        let far = 2.0 * self.config.smoothing_length;
        let (phi, band) = (self.particles.scalar(self.columns.phi), self.particles.flag(self.columns.in_band));
        let mut sums = [[0.0; 3]; Species::ALL.len()];
        for i in 0..phi.len() {
            if band[i] == 1 && phi[i].abs() <= far {
                continue;
            }
            let sum = &mut sums[usize::from(self.flow.species[i].code())];
            sum[0] += 1.0;
            sum[1] += self.flow.pressure[i];
            sum[2] += self.flow.pressure[i] + self.absorbed_pressure(i);
        }
        [Species::Inside, Species::Outside].map(|species| {
            let [count, pressure, full] = sums[usize::from(species.code())];
            (pressure / count, full / count)
        })
    }

    /// Area or volume, center and second moments of the inside, by quadrature on the fits; None without an interface.
    pub(super) fn moments(&self) -> Result<Option<EnclosedMoments<D>>, Interrupted> {
        let Some(interface) = self.interface.level_set() else { return Ok(None) };
        let center = self.circular_center(&interface.surface.sample_points());
        let unwrap = |x: &Vector<D>| center + self.domain.displacement(&center, x);
        enclosed_moments(&interface.surface, unwrap, &self.interrupt).map(Some)
    }

    /// A center from which nothing is cut: along periodic axes opposite to the widest gap between points.
    fn circular_center(&self, points: &[Vector<D>]) -> Vector<D> {
        Vector::<D>::from_fn(|d, _| match self.domain.axes()[d] {
            Axis::Unbounded => points.iter().map(|x| x[d]).sum::<f64>() / points.len().max(1) as f64,
            Axis::Periodic { start, length } => {
                let mut places: Vec<f64> = points.iter().map(|x| x[d]).collect();
                places.sort_by(f64::total_cmp);
                let last = places.last().map_or(start, |last| last - length);
                let before = std::iter::once(last).chain(places.iter().copied());
                let gaps = before.zip(&places).map(|(from, to)| (to - from, 0.5 * (from + to)));
                let (_, middle) = gaps.fold((0.0, start), |most, gap| if gap.0 > most.0 { gap } else { most });
                start + (middle + 0.5 * length - start).rem_euclid(length)
            }
        })
    }

    /// The least distance of two particles, in h.
    fn least_distance(&self) -> f64 {
        let positions = self.particles.positions();
        let mut cells = CellList::new(self.domain.clone());
        let reach = self.config.spacing;
        cells.rebuild(positions.iter().copied(), reach);
        let mut least = reach * reach;
        for (i, x) in positions.iter().enumerate() {
            cells.for_each_within(x, reach, |j, _, r2| {
                if j != i {
                    least = least.min(r2);
                }
            });
        }
        least.sqrt() / self.config.spacing
    }

    /// Everything a row of the series shows.
    pub(super) fn row(&self, time_step: f64, moments: Option<&EnclosedMoments<D>>) -> Row {
        let mut energy = 0.0;
        let mut momentum = Vector::<D>::zeros();
        for (i, u) in self.flow.velocity.iter().enumerate() {
            let mass = self.flow.mass(i);
            energy += 0.5 * mass * u.norm_squared();
            momentum += u * mass;
        }
        let mut row = vec![energy];
        row.extend(momentum.iter());
        let (mean, deviation) = self.curvature_spread();
        row.extend([mean, deviation]);
        let nothing = Vector::<D>::repeat(f64::NAN);
        row.push(moments.map_or(f64::NAN, |m| m.area_or_volume));
        row.extend(moments.map_or(nothing, EnclosedMoments::center).iter());
        row.extend(moments.map_or(nothing, |m| m.high - m.low).iter());
        row.push(moments.map_or(f64::NAN, deformation));
        let [(inside, inside_full), (outside, _)] = self.mean_pressures();
        let droplets = if self.config.has_tension() { self.droplets.number() as f64 } else { f64::NAN };
        let speed = self.flow.largest_speed();
        let sound = self.config.fluids.least_sound_speed();
        row.extend([inside_full, outside, inside - outside, droplets, speed / sound]);
        row.extend([speed * time_step / self.config.spacing, self.least_distance()]);
        row
    }
}

/// (Qxx − Qyy)/(Qxx + Qyy) of the central second moments; in space with the mean of Qyy and Qzz for Qyy.
pub(super) fn deformation<const D: usize>(moments: &EnclosedMoments<D>) -> f64 {
    let variance = moments.variance();
    let across = variance.iter().skip(1).sum::<f64>() / (D - 1) as f64;
    (variance[0] - across) / (variance[0] + across)
}
