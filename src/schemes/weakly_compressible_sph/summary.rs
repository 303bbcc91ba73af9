//! What a run has come to: means of its late part, extremes, and the turns of its shape.

use crate::schemes::measured_errors::entry;
use crate::simulation::ErrorEntry;

/// Sums and extremes over the measured moments of a run.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Summary {
    /// Sums over the last fifth: count, pressure jump, its part by the equation of state, mean curvature.
    late: [f64; 4],
    /// Mean and deviation of the curvature at the last moment, and the least deviation.
    curvature: [f64; 3],
    /// Largest Σ m u.
    momentum: f64,
    pub droplets: f64,
    measure: f64,
    /// The last two moments and deformations.
    shapes: [[f64; 2]; 2],
    /// Where the deformation last turned, or began; and the largest since it last passed zero.
    swing: [f64; 2],
    /// Times at which the deformation passed zero.
    crossings: Vec<f64>,
    /// Times and values of its extremes.
    extremes: Vec<[f64; 2]>,
}

impl Default for Summary {
    fn default() -> Self {
        Self {
            late: [0.0; 4],
            curvature: [f64::NAN, f64::NAN, f64::INFINITY],
            momentum: 0.0,
            droplets: 1.0,
            measure: f64::NAN,
            shapes: [[f64::NAN; 2]; 2],
            swing: [f64::NAN, 0.0],
            crossings: Vec::new(),
            extremes: Vec::new(),
        }
    }
}

/// Swings of the deformation that are more than noise.
const LEAST_SWING: f64 = 0.01;
/// Turns of the shape that are kept.
const MOST_TURNS: usize = 8;

impl Summary {
    /// Numbers before the lists.
    pub const HEAD: usize = 19;

    /// Takes pressure jump, its part by the equation of state, mean and deviation of the curvature, and |Σ m u|.
    pub fn take(&mut self, is_late: bool, [jump, eos, mean, deviation, momentum]: [f64; 5]) {
        if is_late {
            for (sum, value) in self.late.iter_mut().zip([1.0, jump, eos, mean]) {
                *sum += value;
            }
        }
        self.curvature = [mean, deviation, self.curvature[2].min(deviation)];
        self.momentum = self.momentum.max(momentum);
    }

    /// Takes the enclosed measure and the deformation; tells of a turn that has just been passed.
    pub fn take_shape(&mut self, time: f64, measure: f64, value: f64) -> Option<(&'static str, String)> {
        self.measure = measure;
        let [[t0, d0], [t1, d1]] = self.shapes;
        if time <= t1 {
            return None;
        }
        self.shapes = [[t1, d1], [time, value]];
        if self.swing[0].is_nan() {
            self.swing[0] = value;
        }
        self.swing[1] = self.swing[1].max(value.abs());
        let mut found = None;
        if d1 * value < 0.0 && self.swing[1] > LEAST_SWING && self.crossings.len() < MOST_TURNS {
            self.crossings.push(t1 + (time - t1) * d1 / (d1 - value));
            self.swing[1] = 0.0;
        }
        if (d1 - d0) * (value - d1) < 0.0 && self.extremes.len() < MOST_TURNS {
            // The vertex of the parabola through the three.
            let (a, b) = ((d1 - d0) / (t1 - t0), (value - d1) / (time - t1));
            let bend = (b - a) / (time - t0);
            let vertex = 0.5 * (t0 + t1) - 0.5 * a / bend;
            let height = d1 + (vertex - t1) * (a + bend * (vertex - t0));
            if (height - self.swing[0]).abs() < LEAST_SWING {
                return None;
            }
            self.swing[0] = height;
            self.extremes.push([vertex, height]);
            let is_first = self.extremes.len() == 1;
            let message = format!("the deformation turned at {height:.4}, time {vertex:.4}");
            found = Some((if is_first { "largest_elongation" } else { "turned" }, message));
        }
        found
    }

    pub fn last_measure(&self) -> Option<f64> {
        Some(self.measure).filter(|measure| measure.is_finite())
    }

    pub fn to_numbers(&self, end: f64) -> Vec<f64> {
        let mut numbers = vec![end];
        numbers.extend(self.late);
        numbers.extend(self.curvature);
        numbers.extend([self.momentum, self.droplets, self.measure]);
        numbers.extend(self.shapes.as_flattened());
        numbers.extend(self.swing);
        numbers.extend([self.crossings.len() as f64, self.extremes.len() as f64]);
        numbers.extend(&self.crossings);
        numbers.extend(self.extremes.as_flattened());
        numbers
    }

    /// None where the numbers are none of a summary. What was summed for another end is forgotten.
    pub fn from_numbers(numbers: &[f64], end: f64) -> Option<Self> {
        let (head, lists) = numbers.split_at_checked(Self::HEAD)?;
        let (crossings, extremes) = (head[17] as usize, head[18] as usize);
        if lists.len() != crossings + 2 * extremes {
            return None;
        }
        let is_same_end = head[0].to_bits() == end.to_bits();
        Some(Self {
            late: if is_same_end { [head[1], head[2], head[3], head[4]] } else { [0.0; 4] },
            curvature: [head[5], head[6], head[7]],
            momentum: head[8],
            droplets: head[9],
            measure: head[10],
            shapes: [[head[11], head[12]], [head[13], head[14]]],
            swing: [head[15], head[16]],
            crossings: lists[..crossings].to_vec(),
            extremes: lists[crossings..].as_chunks::<2>().0.to_vec(),
        })
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
        let [count, jumps, eos, means] = self.late.map(|sum| sum / self.late[0]);
        if count.is_finite() && self.droplets < 1.5 {
            let late = "Young–Laplace, mean of the last fifth";
            add("pressure_jump", "relative", (jumps / jump - 1.0).abs(), time, late);
            add("pressure_jump", "mean", jumps, time, "mean of the last fifth");
            add("pressure_eos_jump", "relative", (eos / jump).abs(), time, late);
            add("curvature", "mean_error", (means - curvature).abs(), time, "ball of the initial measure");
        }
        add("curvature", "mean", self.curvature[0], time, "over the band");
        add("curvature", "std", self.curvature[1], time, "over the band");
        add("curvature", "std_least", self.curvature[2], time, "over the band, least of the run");
        let name = if dimension == 2 { "area" } else { "volume" };
        add(name, "relative", (self.measure / measure - 1.0).abs(), time, "conservation");
        if self.droplets < 1.5 {
            let power = if dimension == 2 { -0.5 } else { -1.0 / 3.0 };
            let of_measure = curvature * (self.measure / measure).powf(power);
            add("curvature", "of_measure", (self.curvature[0] / of_measure - 1.0).abs(), time, "ball of the measure");
        }
        add("momentum", "max", self.momentum, time, "conservation");
        add("droplets", "count", self.droplets, time, "connected components");
        for (k, crossing) in self.crossings.iter().enumerate() {
            add("deformation", CROSSINGS[k], *crossing, *crossing, "time of the passage");
        }
        for (k, [at, value]) in self.extremes.iter().enumerate() {
            add("deformation", EXTREMES[k], *value, *at, "value of the extreme");
            add("deformation_time", EXTREMES[k], *at, *at, "time of the extreme");
        }
        entries
    }
}

const CROSSINGS: [&str; MOST_TURNS] = ["zero_1", "zero_2", "zero_3", "zero_4", "zero_5", "zero_6", "zero_7", "zero_8"];
const EXTREMES: [&str; MOST_TURNS] =
    ["extreme_1", "extreme_2", "extreme_3", "extreme_4", "extreme_5", "extreme_6", "extreme_7", "extreme_8"];

#[cfg(test)]
mod tests {
    use super::Summary;

    #[test]
    fn turns_of_a_cosine_are_found_and_survive_a_round_trip() {
        let mut summary = Summary::default();
        for k in 0..=400 {
            let time = f64::from(k) * 0.0025;
            summary.take_shape(time, 1.0, (20.0 * time).cos());
        }
        assert!((summary.crossings[0] - std::f64::consts::PI / 40.0).abs() < 1e-5);
        assert!((summary.extremes[0][0] - std::f64::consts::PI / 20.0).abs() < 1e-5);
        assert!((summary.extremes[0][1] + 1.0).abs() < 1e-5);
        let numbers = summary.to_numbers(1.0);
        let again = Summary::from_numbers(&numbers, 1.0).unwrap();
        assert_eq!(again.to_numbers(1.0).len(), numbers.len());
        assert_eq!(again.extremes, summary.extremes);
        assert!(Summary::from_numbers(&numbers[..numbers.len() - 1], 1.0).is_none());
    }
}
