//! What a run has come to: means of its late part, extremes, and the turns of its shape.

use super::quantities::{CROSSINGS, EXTREMES, MOST_TURNS};
use crate::schemes::measured_errors::entry;
use crate::simulation::section::{check_length, known};
use crate::simulation::{Component, ErrorEntry, LoadError, Section};

/// Sums and extremes over the measured states of a run.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Summary {
    pub late: Late,
    pub kinetic: ThirdMeans,
    /// Mean and standard deviation of the curvature in the last measured state; NaN before.
    pub curvature_mean: f64,
    pub curvature_std: f64,
    /// Least standard deviation of the curvature; infinite before the first.
    pub least_curvature_std: f64,
    /// Largest Σ m u.
    pub momentum: f64,
    /// Largest speed about the mean velocity.
    pub largest_speed: f64,
    /// Connected components of the inner fluid.
    pub droplets: f64,
    /// Enclosed area or volume in the last measured state; NaN before.
    pub measure: f64,
    /// The last two measured states.
    pub before_last: Shape,
    pub last: Shape,
    /// Deformation at its last turn, or at the start; NaN before.
    pub turned_at: f64,
    /// Largest size of the deformation since it last passed zero.
    pub largest_since_zero: f64,
    /// Times at which the deformation passed zero.
    pub crossings: Vec<f64>,
    pub extremes: Vec<Shape>,
}

/// Sums over the last fifth of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Late {
    /// End of the run that the last fifth is of.
    pub end_time: f64,
    pub count: f64,
    pub pressure_jump: f64,
    pub pressure_eos_jump: f64,
    pub pressure_jump_measured: f64,
    pub pressure_balanced: f64,
    pub curvature: f64,
}

/// Kinetic energy over the middle and the last third of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct ThirdMeans {
    /// Counts and sums of both thirds.
    pub counts: [f64; 2],
    pub sums: [f64; 2],
    /// Largest of the last third.
    pub largest: f64,
}

impl ThirdMeans {
    /// Takes a value at a part of the run from 0 to 1.
    fn take(&mut self, part: f64, value: f64) {
        let Some(third) = (part >= 1.0 / 3.0).then_some(usize::from(part >= 2.0 / 3.0)) else { return };
        self.counts[third] += 1.0;
        self.sums[third] += value;
        if third == 1 {
            self.largest = self.largest.max(value);
        }
    }

    /// Means of the middle and the last third; NaN where nothing was measured.
    fn means(&self) -> [f64; 2] {
        std::array::from_fn(|third| self.sums[third] / self.counts[third])
    }
}

impl Component for ThirdMeans {
    fn save(&self, section: &mut Section) {
        section.put_reals("counts", &self.counts);
        section.put_reals("sums", &self.sums);
        section.put_real("largest", self.largest);
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        let two = |name: &str| Ok::<_, LoadError>([section.reals_of(name, 2)?[0], section.reals_of(name, 2)?[1]]);
        Ok(Self { counts: two("counts")?, sums: two("sums")?, largest: section.real("largest")? })
    }
}

/// The deformation at a time; NaN where nothing was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shape {
    pub time: f64,
    pub deformation: f64,
}

impl Shape {
    const UNKNOWN: Self = Self { time: f64::NAN, deformation: f64::NAN };
}

/// Swings of the deformation that are more than noise.
const LEAST_SWING: f64 = 0.01;

impl Late {
    fn new(end_time: f64) -> Self {
        Self {
            end_time,
            count: 0.0,
            pressure_jump: 0.0,
            pressure_eos_jump: 0.0,
            pressure_jump_measured: 0.0,
            pressure_balanced: 0.0,
            curvature: 0.0,
        }
    }
}

/// A sum that earlier versions may not have; NaN where it is not known.
fn sum_if_any(section: &Section, name: &str) -> Result<f64, LoadError> {
    let found = if section.has(name) { section.optional(name)? } else { None };
    Ok(found.unwrap_or(f64::NAN))
}

impl Component for Late {
    fn save(&self, section: &mut Section) {
        section.put_real("end_time", self.end_time);
        section.put_real("count", self.count);
        // Sums of what is not known stay unknown.
        section.put_optional("pressure_jump", known(self.pressure_jump));
        section.put_optional("pressure_eos_jump", known(self.pressure_eos_jump));
        section.put_optional("pressure_jump_measured", known(self.pressure_jump_measured));
        section.put_optional("pressure_balanced", known(self.pressure_balanced));
        section.put_optional("curvature", known(self.curvature));
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        Ok(Self {
            end_time: section.real("end_time")?,
            count: section.real("count")?,
            pressure_jump: section.optional("pressure_jump")?.unwrap_or(f64::NAN),
            pressure_eos_jump: section.optional("pressure_eos_jump")?.unwrap_or(f64::NAN),
            // Version 0.2.0 did not measure them: its sums stay unknown.
            pressure_jump_measured: sum_if_any(section, "pressure_jump_measured")?,
            pressure_balanced: sum_if_any(section, "pressure_balanced")?,
            curvature: section.optional("curvature")?.unwrap_or(f64::NAN),
        })
    }
}

impl Component for Shape {
    fn save(&self, section: &mut Section) {
        section.put_optional("time", known(self.time));
        section.put_optional("deformation", known(self.deformation));
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        Ok(Self {
            time: section.optional("time")?.unwrap_or(f64::NAN),
            deformation: section.optional("deformation")?.unwrap_or(f64::NAN),
        })
    }
}

impl Component for Summary {
    fn save(&self, section: &mut Section) {
        section.put_component("late", &self.late);
        section.put_component("kinetic", &self.kinetic);
        section.put_optional("curvature_mean", known(self.curvature_mean));
        section.put_optional("curvature_std", known(self.curvature_std));
        section.put_optional("least_curvature_std", known(self.least_curvature_std));
        section.put_real("momentum", self.momentum);
        section.put_real("largest_speed", self.largest_speed);
        section.put_real("droplets", self.droplets);
        section.put_optional("measure", known(self.measure));
        section.put_component("before_last", &self.before_last);
        section.put_component("last", &self.last);
        section.put_optional("turned_at", known(self.turned_at));
        section.put_real("largest_since_zero", self.largest_since_zero);
        section.put_reals("crossings", &self.crossings);
        let extreme = |of: fn(&Shape) -> f64| self.extremes.iter().map(of).collect::<Vec<f64>>();
        section.put_reals("extreme_times", &extreme(|extreme| extreme.time));
        section.put_reals("extreme_values", &extreme(|extreme| extreme.deformation));
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        let or_nan = |name: &str| Ok::<f64, LoadError>(section.optional(name)?.unwrap_or(f64::NAN));
        let crossings = section.reals("crossings")?;
        check_length("crossings", crossings.len(), crossings.len().min(MOST_TURNS))?;
        let times = section.reals("extreme_times")?;
        check_length("extreme_times", times.len(), times.len().min(MOST_TURNS))?;
        let values = section.reals_of("extreme_values", times.len())?;
        let extreme = |(time, deformation): (&f64, &f64)| Shape { time: *time, deformation: *deformation };
        Ok(Self {
            late: section.component("late")?,
            // Version 0.2.0 did not measure it.
            kinetic: if section.has("kinetic") { section.component("kinetic")? } else { ThirdMeans::default() },
            curvature_mean: or_nan("curvature_mean")?,
            curvature_std: or_nan("curvature_std")?,
            least_curvature_std: section.optional("least_curvature_std")?.unwrap_or(f64::INFINITY),
            momentum: section.real("momentum")?,
            // Version 0.2.0 did not measure it.
            largest_speed: if section.has("largest_speed") { section.real("largest_speed")? } else { 0.0 },
            droplets: section.real("droplets")?,
            measure: or_nan("measure")?,
            before_last: section.component("before_last")?,
            last: section.component("last")?,
            turned_at: or_nan("turned_at")?,
            largest_since_zero: section.real("largest_since_zero")?,
            crossings: crossings.to_vec(),
            extremes: times.iter().zip(values).map(extreme).collect(),
        })
    }
}

impl Summary {
    /// Nothing measured yet, of a run to an end.
    pub fn new(end_time: f64) -> Self {
        Self {
            late: Late::new(end_time),
            kinetic: ThirdMeans::default(),
            curvature_mean: f64::NAN,
            curvature_std: f64::NAN,
            least_curvature_std: f64::INFINITY,
            momentum: 0.0,
            largest_speed: 0.0,
            droplets: 1.0,
            measure: f64::NAN,
            before_last: Shape::UNKNOWN,
            last: Shape::UNKNOWN,
            turned_at: f64::NAN,
            largest_since_zero: 0.0,
            crossings: Vec::new(),
            extremes: Vec::new(),
        }
    }

    /// The same for a run to an end; sums for another end are forgotten.
    pub fn with_end(mut self, end_time: f64) -> Self {
        if self.late.end_time.to_bits() != end_time.to_bits() {
            (self.late, self.kinetic) = (Late::new(end_time), ThirdMeans::default());
        }
        self
    }

    /// Takes the pressure jump as a whole, by the equation of state, as measured and as put in; mean and deviation of the
    /// curvature; and |Σ m u|.
    pub fn take(&mut self, is_late: bool, jumps: [f64; 4], [mean, deviation]: [f64; 2], momentum: f64) {
        if is_late {
            let late = &mut self.late;
            late.count += 1.0;
            late.curvature += mean;
            let sums = [
                &mut late.pressure_jump,
                &mut late.pressure_eos_jump,
                &mut late.pressure_jump_measured,
                &mut late.pressure_balanced,
            ];
            for (sum, jump) in sums.into_iter().zip(jumps) {
                *sum += jump;
            }
        }
        (self.curvature_mean, self.curvature_std) = (mean, deviation);
        self.least_curvature_std = self.least_curvature_std.min(deviation);
        self.momentum = self.momentum.max(momentum);
    }

    /// Takes the kinetic energy at a time.
    pub fn take_energy(&mut self, time: f64, kinetic: f64) {
        self.kinetic.take(time / self.late.end_time, kinetic);
    }

    /// Angular frequency and rate of decay of an oscillation, from the times and the differences of successive extremes of the
    /// deformation; None with fewer than four.
    fn oscillation(&self) -> Option<(f64, f64)> {
        let (first, last) = (self.extremes.first()?, self.extremes.last()?);
        let swings: Vec<f64> =
            self.extremes.windows(2).map(|two| (two[1].deformation - two[0].deformation).abs()).collect();
        let halves = swings.len() as f64;
        if swings.len() < 3 {
            return None;
        }
        let half_period = (last.time - first.time) / halves;
        let decay = (swings[0] / swings[swings.len() - 1]).ln() / ((halves - 1.0) * half_period);
        Some((std::f64::consts::PI / half_period, decay))
    }

    /// Takes the enclosed measure and the deformation; code and message of a turn that has just been passed.
    pub fn take_shape(&mut self, time: f64, measure: f64, value: f64) -> Option<(&'static str, String)> {
        self.measure = measure;
        let (Shape { time: t0, deformation: d0 }, Shape { time: t1, deformation: d1 }) = (self.before_last, self.last);
        if time <= t1 {
            return None;
        }
        (self.before_last, self.last) = (self.last, Shape { time, deformation: value });
        if self.turned_at.is_nan() {
            self.turned_at = value;
        }
        self.largest_since_zero = self.largest_since_zero.max(value.abs());
        let mut found = None;
        if d1 * value < 0.0 && self.largest_since_zero > LEAST_SWING && self.crossings.len() < MOST_TURNS {
            self.crossings.push(t1 + (time - t1) * d1 / (d1 - value));
            self.largest_since_zero = 0.0;
        }
        if (d1 - d0) * (value - d1) < 0.0 && self.extremes.len() < MOST_TURNS {
            // The vertex of the parabola through the three.
            let (a, b) = ((d1 - d0) / (t1 - t0), (value - d1) / (time - t1));
            let bend = (b - a) / (time - t0);
            let vertex = 0.5 * (t0 + t1) - 0.5 * a / bend;
            let height = d1 + (vertex - t1) * (a + bend * (vertex - t0));
            if (height - self.turned_at).abs() < LEAST_SWING {
                return None;
            }
            self.turned_at = height;
            self.extremes.push(Shape { time: vertex, deformation: height });
            let is_first = self.extremes.len() == 1;
            let message = format!("the deformation turned at {height:.4}, time {vertex:.4}");
            found = Some((if is_first { "largest_elongation" } else { "turned" }, message));
        }
        found
    }

    pub fn last_measure(&self) -> Option<f64> {
        known(self.measure)
    }

    /// Report entries; `expected` is the pressure jump, curvature and measure of one ball at rest.
    pub fn entries(&self, dimension: usize, time: f64, expected: (f64, f64, f64)) -> Vec<ErrorEntry> {
        let (jump, curvature, measure) = expected;
        let mut entries = Vec::new();
        let mut add = |quantity: &str, norm: &str, value: f64, time: f64, reference: &str| {
            if value.is_finite() {
                entries.push(entry(quantity, norm, value, time, reference));
            }
        };
        let Late { count, .. } = self.late;
        let mean = |of: fn(&Late) -> f64| of(&self.late) / count;
        let [jumps, eos, means] =
            [mean(|late| late.pressure_jump), mean(|late| late.pressure_eos_jump), mean(|late| late.curvature)];
        let [measured, balanced] = [mean(|late| late.pressure_jump_measured), mean(|late| late.pressure_balanced)];
        if count > 0.0 && self.droplets < 1.5 {
            let late = "Young–Laplace, mean of the last fifth";
            add("pressure_jump_measured", "relative", (measured / jump - 1.0).abs(), time, late);
            add("pressure_jump_measured", "mean", measured, time, "mean of the last fifth");
            add("pressure_balanced", "mean", balanced, time, "put in, mean of the last fifth");
            add("pressure_jump", "relative", (jumps / jump - 1.0).abs(), time, late);
            add("pressure_jump", "mean", jumps, time, "mean of the last fifth");
            add("pressure_eos_jump", "relative", (eos / jump).abs(), time, late);
            add("curvature", "mean_error", (means - curvature).abs(), time, "ball of the initial measure");
        }
        add("curvature", "mean", self.curvature_mean, time, "over the band");
        add("curvature", "std", self.curvature_std, time, "over the band");
        add("curvature", "std_least", self.least_curvature_std, time, "over the band, least of the run");
        let name = if dimension == 2 { "area" } else { "volume" };
        add(name, "relative", (self.measure / measure - 1.0).abs(), time, "conservation");
        if self.droplets < 1.5 {
            let power = if dimension == 2 { -0.5 } else { -1.0 / 3.0 };
            let of_measure = curvature * (self.measure / measure).powf(power);
            add("curvature", "of_measure", (self.curvature_mean / of_measure - 1.0).abs(), time, "ball of the measure");
        }
        add("momentum", "max", self.momentum, time, "conservation");
        let [middle, last] = self.kinetic.means();
        add("kinetic_energy", "mean", last, time, "mean of the last third");
        add("kinetic_energy", "max", self.kinetic.largest, time, "largest of the last third");
        add("kinetic_energy", "ratio", last / middle, time, "mean of the last third by that of the middle third");
        if let Some((frequency, decay)) = self.oscillation() {
            add("deformation", "frequency", frequency, time, "angular frequency, from the extremes");
            add("deformation", "decay", decay, time, "rate of decay, from the extremes");
        }
        add("droplets", "count", self.droplets, time, "connected components");
        for (k, crossing) in self.crossings.iter().enumerate() {
            add("deformation", CROSSINGS[k].name, *crossing, *crossing, "time of the passage");
        }
        for (k, Shape { time: at, deformation: value }) in self.extremes.iter().enumerate() {
            add("deformation", EXTREMES[k].name, *value, *at, "value of the extreme");
            add("deformation_time", EXTREMES[k].name, *at, *at, "time of the extreme");
        }
        entries
    }
}

#[cfg(test)]
mod tests {
    use super::{Component, Section, Summary};

    #[test]
    fn turns_of_a_cosine_are_found_and_survive_a_round_trip() {
        let mut summary = Summary::new(1.0);
        for k in 0..=400 {
            let time = f64::from(k) * 0.0025;
            summary.take_shape(time, 1.0, (20.0 * time).cos());
        }
        assert!((summary.crossings[0] - std::f64::consts::PI / 40.0).abs() < 1e-5);
        assert!((summary.extremes[0].time - std::f64::consts::PI / 20.0).abs() < 1e-5);
        assert!((summary.extremes[0].deformation + 1.0).abs() < 1e-5);
        summary.take(true, [1.0, 2.0, 3.0, 4.0], [5.0, 6.0], 7.0);
        let mut section = Section::default();
        summary.save(&mut section);
        assert_eq!(section.find_non_finite(), None);
        let again = Summary::load(&section).unwrap();
        assert_eq!(again, summary);
        let (frequency, decay) = summary.oscillation().unwrap();
        assert!((frequency - 20.0).abs() < 1e-3 && decay.abs() < 1e-3, "{frequency} {decay}");
        assert_eq!(again.clone().with_end(1.0), summary);
        assert_eq!(again.with_end(2.0).late.count.to_bits(), 0_f64.to_bits(), "sums for another end are forgotten");
        section.put_reals("extreme_values", &[0.0]);
        assert!(Summary::load(&section).is_err());
    }

    #[test]
    fn a_summary_of_nothing_survives_a_round_trip() {
        let mut section = Section::default();
        Summary::new(1.0).save(&mut section);
        let again = Summary::load(&section).unwrap();
        assert!(again.measure.is_nan() && again.last.time.is_nan() && again.least_curvature_std.is_infinite());
    }
}
