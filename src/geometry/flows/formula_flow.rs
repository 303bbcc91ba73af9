//! A flow by formulas that a user writes.

use super::{Flow, Vector};
use crate::formulas::{BLOCK, Bound, Context, FormulaList, Input, NamedNumbers};
use crate::geometry::block::indices;
use crate::spec::Violation;

/// The flow u(x, t) whose components are formulas of x, y (z in space) and t.
#[derive(Debug, Clone)]
pub struct FormulaFlow<const D: usize> {
    velocity: Bound,
    /// ∂u_d/∂x_d, whose sum is the divergence.
    stretchings: Bound,
    period: Option<f64>,
    end_time: f64,
}

/// Tuning constants of the bound of the speed.
struct SpeedTuning {
    /// Points along an axis that are carried along, in the plane and in space.
    points: [usize; 2],
    /// Instants at which their speeds are looked at.
    instants: usize,
    /// The bound relative to the largest speed found: particles between the points may be faster.
    margin: f64,
}

const TUNING: SpeedTuning = SpeedTuning { points: [12, 7], instants: 100, margin: 1.05 };

/// Divergence relative to the rate of strain below which a flow counts as free of divergence: round-off.
const ROUND_OFF: f64 = 1e-11;

/// Names of the variables in `D` dimensions.
fn variables<const D: usize>() -> &'static [&'static str] {
    if D == 2 { &["x", "y", "t"] } else { &["x", "y", "z", "t"] }
}

impl<const D: usize> FormulaFlow<D> {
    /// A flow until `end_time`. Pointers of errors begin with `pointer`.
    ///
    /// # Errors
    /// Another number of formulas than dimensions, and all that is wrong with them.
    pub fn new(
        velocity: &FormulaList,
        parameters: &NamedNumbers,
        period: Option<f64>,
        end_time: f64,
        pointer: &str,
    ) -> Result<Self, Vec<Violation>> {
        let formulas = velocity.components::<D>(pointer, "velocity").map_err(|error| vec![error])?;
        let velocity = Bound::new(&formulas, Context { pointer, variables: variables::<D>(), parameters })?;
        let own_axis: Vec<Vec<usize>> = (0..D).map(|d| vec![d]).collect();
        Ok(Self { stretchings: velocity.derivatives(&own_axis), velocity, period, end_time })
    }

    fn inputs<'a>(columns: &'a [[f64; BLOCK]; 3], times: &'a [f64], count: usize) -> [Input<'a>; 4] {
        let time =
            if times.iter().all(|time| *time == times[0]) { Input::Uniform(times[0]) } else { Input::Column(times) };
        let column = |d: usize| Input::Column(&columns[d][..count]);
        if D == 2 { [column(0), column(1), time, time] } else { [column(0), column(1), column(2), time] }
    }

    /// Calls `write(k, i, value)` for formula k of `formulas` at point i.
    fn evaluate(formulas: &Bound, points: &[Vector<D>], times: &[f64], mut write: impl FnMut(usize, usize, f64)) {
        for (block, (points, times)) in points.chunks(BLOCK).zip(times.chunks(BLOCK)).enumerate() {
            let mut columns = [[0.0; BLOCK]; 3];
            for (i, x) in points.iter().enumerate() {
                for d in 0..D {
                    columns[d][i] = x[d];
                }
            }
            let inputs = Self::inputs(&columns, times, points.len());
            formulas.block(&inputs[..=D], points.len(), |k, i, value| write(k, block * BLOCK + i, value));
        }
    }

    /// Whether all ∂u_d/∂x_d on a lattice of paths from a box cancel to round-off.
    fn has_no_divergence(&self, low: &Vector<D>, high: &Vector<D>) -> bool {
        self.sampled_paths(low, high).iter().step_by(9).all(|(points, time)| {
            let mut sums = vec![0.0_f64; points.len()];
            let mut strain = 0.0_f64;
            Self::evaluate(&self.stretchings, points, &vec![*time; points.len()], |_, i, value| {
                sums[i] += value;
                // Where points are carried off, nothing is finite any more.
                strain = if value.is_finite() { strain.max(value.abs()) } else { strain };
            });
            let finite = sums.iter().filter(|sum| sum.is_finite());
            finite.fold(0.0_f64, |most, sum| most.max(sum.abs())) <= ROUND_OFF * strain
        })
    }

    /// Places and times that paths from a box meet until the end of the run.
    fn sampled_paths(&self, low: &Vector<D>, high: &Vector<D>) -> Vec<(Vec<Vector<D>>, f64)> {
        let count = TUNING.points[D - 2];
        let place = |k: usize| {
            let node = indices(k, &[count; D]);
            Vector::<D>::from_fn(|d, _| low[d] + node[d] as f64 / (count - 1) as f64 * (high[d] - low[d]))
        };
        let mut points: Vec<Vector<D>> = (0..count.pow(D as u32)).map(place).collect();
        let length = self.period.map_or(self.end_time, |period| period.min(self.end_time));
        let step = length / TUNING.instants as f64;
        let mut velocities = vec![Vector::<D>::zeros(); points.len()];
        let mut paths = Vec::new();
        for k in 0..=TUNING.instants {
            let time = k as f64 * step;
            paths.push((points.clone(), time));
            let mut halfway = points.clone();
            self.velocities(&points, &vec![time; points.len()], &mut velocities);
            for (x, u) in halfway.iter_mut().zip(&velocities) {
                *x += u * (0.5 * step);
            }
            self.velocities(&halfway, &vec![time + 0.5 * step; points.len()], &mut velocities);
            for (x, u) in points.iter_mut().zip(&velocities) {
                *x += u * step;
            }
        }
        paths
    }
}

impl<const D: usize> Flow<D> for FormulaFlow<D> {
    fn velocity(&self, x: &Vector<D>, time: f64) -> Vector<D> {
        let mut velocity = [Vector::<D>::zeros()];
        self.velocities(&[*x], &[time], &mut velocity);
        velocity[0]
    }

    fn velocities(&self, points: &[Vector<D>], times: &[f64], velocities: &mut [Vector<D>]) {
        Self::evaluate(&self.velocity, points, times, |d, i, value| velocities[i][d] = value);
    }

    fn divergences(&self, points: &[Vector<D>], time: f64) -> Option<Vec<f64>> {
        let mut divergences = vec![0.0; points.len()];
        Self::evaluate(&self.stretchings, points, &vec![time; points.len()], |_, i, value| divergences[i] += value);
        Some(divergences)
    }

    fn keeps_volume(&self, low: &Vector<D>, high: &Vector<D>) -> bool {
        self.has_no_divergence(low, high)
    }

    fn fault(&self, x: &Vector<D>, time: f64) -> Option<String> {
        let mut at: Vec<f64> = x.iter().copied().collect();
        at.push(time);
        self.velocity.fault(&at).map(|fault| format!("{fault} (a component of the velocity)"))
    }

    fn relative_cost(&self) -> f64 {
        // Single vortices have about 12 operations, which cost as much as the built-in ones.
        1.0 + self.velocity.operations() as f64 / 12.0
    }

    fn top_speed(&self, low: &Vector<D>, high: &Vector<D>) -> f64 {
        let mut fastest = 0.0_f64;
        for (points, time) in self.sampled_paths(low, high) {
            let mut velocities = vec![Vector::<D>::zeros(); points.len()];
            self.velocities(&points, &vec![time; points.len()], &mut velocities);
            fastest = velocities.iter().fold(fastest, |most, u| most.max(u.norm()));
        }
        TUNING.margin * fastest
    }

    fn return_time(&self) -> Option<f64> {
        self.period
    }
}

#[cfg(test)]
mod tests {
    use super::super::SingleVortex;
    use super::{Flow, FormulaFlow, Vector};
    use crate::formulas::NamedNumbers;

    fn flow(velocity: [&str; 2]) -> FormulaFlow<2> {
        let numbers = NamedNumbers(vec![("T".to_owned(), 8.0)]);
        FormulaFlow::new(&velocity.into(), &numbers, Some(8.0), 8.0, "/flow").unwrap()
    }

    fn single_vortex() -> FormulaFlow<2> {
        flow(["-2*cos(pi*t/T)*sin(pi*x)^2*sin(pi*y)*cos(pi*y)", "2*cos(pi*t/T)*sin(pi*y)^2*sin(pi*x)*cos(pi*x)"])
    }

    #[test]
    fn the_single_vortex_by_formula_is_the_built_in_one() {
        let (written, built) = (single_vortex(), SingleVortex { period: Some(8.0) });
        let points: Vec<Vector<2>> =
            (0..200).map(|k| Vector::<2>::new(0.01 * f64::from(k) - 0.4, 1.1 - 0.007 * f64::from(k))).collect();
        let times: Vec<f64> = (0..200).map(|k| 0.05 * f64::from(k)).collect();
        let mut found = vec![Vector::<2>::zeros(); 200];
        written.velocities(&points, &times, &mut found);
        for ((x, t), u) in points.iter().zip(&times).zip(&found) {
            assert!((u - built.velocity(x, *t)).norm() < 5e-16, "{x:?}");
            assert_eq!(*u, written.velocity(x, *t), "alone as among others");
        }
        let (low, high) = (Vector::<2>::zeros(), Vector::<2>::repeat(1.0));
        let speed = written.top_speed(&low, &high);
        assert!((0.97..1.1).contains(&speed), "{speed}");
    }

    #[test]
    fn divergence_is_exact() {
        let (low, high) = (Vector::<2>::repeat(-0.1), Vector::<2>::repeat(1.1));
        assert!(single_vortex().keeps_volume(&low, &high));
        let source = flow(["x^2", "sin(t)*y"]);
        assert!(!source.keeps_volume(&low, &high));
        // What counts is where the particles come.
        let far = flow(["max(x - 5, 0)", "0"]);
        assert!(far.keeps_volume(&low, &high) && !far.keeps_volume(&low, &(high * 10.0)));
        let found = source.divergences(&[Vector::<2>::new(0.3, 7.0)], 0.5).unwrap();
        assert!((found[0] - 0.6 - 0.5_f64.sin()).abs() < 1e-15);
    }

    #[test]
    fn a_place_without_a_velocity_is_told() {
        let found = flow(["1/x", "0"]).fault(&Vector::<2>::new(0.0, 0.5), 0.25).unwrap();
        assert!(found.contains("\"1/x\" is inf at x = 0, y = 0.5, t = 0.25"), "{found}");
    }
}
