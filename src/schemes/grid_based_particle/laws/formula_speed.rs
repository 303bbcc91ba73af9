//! Motion along the normal with a speed that a user writes as a formula of place, normal, curvature and time.

use super::{FrontAtStart, FrontLaw, MotionStep, MovingFront, StepPlan, staged_motion};
use crate::formulas::{BLOCK, Bound, Context, FormulaText, Input, NamedNumbers};
use crate::geometry::block::indices;
use crate::geometry::flows::Stretch;
use crate::geometry::{Vector, shown};
use crate::schemes::grid_based_particle::curvature_stability::{StabilityPlan, longest_step};
use crate::schemes::grid_based_particle::foot_points::FootPoints;
use crate::spec::Violation;
use crate::time::integrators::PathError;
use serde_json::{Value, json};

/// The law of a speed F(x, n, k, t) along the outward normal, k = ∇·n.
#[derive(Debug, Clone)]
pub struct FormulaSpeed<const D: usize> {
    speed: Bound,
    /// ∂F/∂k: where it is negative, curvature smooths the front.
    by_curvature: Bound,
    /// What was found of the speed about the front at the start.
    found: Samples,
    end_time: f64,
}

/// Bounds of the speed about the front at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Samples {
    least: f64,
    largest: f64,
    /// Largest −∂F/∂k: the front smooths like heat with this diffusivity.
    diffusivity: f64,
}

/// Default CFL number dt · |F|/h, that of GBPM 4.1.
const DEFAULT_CFL: f64 = 0.75;
/// Default of dt b/h² with b = −∂F/∂k; the longest stable step replaces it where that is shorter.
const DEFAULT_STEP: f64 = 0.5;
/// Places along an axis of the box about the front, and how far that box is stretched.
const PLACES: usize = 5;
const STRETCH: f64 = 1.5;
/// The largest speed relative to that found.
const MARGIN: f64 = 1.1;
/// Smoothing found during a run, relative to that at the start, up to which steps stay stable.
const MORE_SMOOTHING: f64 = 1.2;

const fn variables<const D: usize>() -> &'static [&'static str] {
    if D == 2 { &["x", "y", "nx", "ny", "k", "t"] } else { &["x", "y", "z", "nx", "ny", "nz", "k", "t"] }
}

impl<const D: usize> FormulaSpeed<D> {
    /// A law about a front that starts within a box, until `end_time`. Pointers of errors begin with `pointer`.
    ///
    /// # Errors
    /// All that is wrong with the formula, a speed that is nowhere finite about the front, and one that makes the front rough.
    pub fn new(
        speed: &FormulaText,
        parameters: &NamedNumbers,
        (low, high): (Vector<D>, Vector<D>),
        end_time: f64,
        pointer: &str,
    ) -> Result<Self, Vec<Violation>> {
        let context = Context { pointer, variables: variables::<D>(), parameters };
        let speed_formula = Bound::new(&[("speed".to_owned(), speed)], context)?;
        let by_curvature = speed_formula.derivatives(&[vec![2 * D]]);
        let refuse = |detail: String, allowed: Value| {
            vec![Violation::new(format!("{pointer}/speed"), "conflict", detail, json!(speed.0), allowed)]
        };
        let (mut least, mut largest) = (f64::INFINITY, f64::NEG_INFINITY);
        let (mut diffusivity, mut roughening) = (0.0_f64, 0.0_f64);
        for at in samples(&low, &high, end_time) {
            let (found, slope) = (speed_formula.at(&at)[0], by_curvature.at(&at)[0]);
            if found.is_finite() {
                (least, largest) = (least.min(found), largest.max(found));
            }
            if slope.is_finite() {
                (diffusivity, roughening) = (diffusivity.max(-slope), roughening.max(slope));
            }
        }
        if least > largest {
            return Err(refuse("the speed has no finite value about the front".to_owned(), Value::Null));
        }
        if roughening > 1e-9 * diffusivity.max(largest.abs()).max(least.abs()) {
            let detail = format!(
                "the speed grows with the curvature k (by {roughening:.3e} at least somewhere about the front): every bend would \
                 become sharper at once, and no computation could follow"
            );
            return Err(refuse(detail, json!("a speed that does not grow with k, such as 1 - 0.1*k")));
        }
        Ok(Self { speed: speed_formula, by_curvature, found: Samples { least, largest, diffusivity }, end_time })
    }

    /// Calls `write(i, value)` with the value of a formula at all particles.
    fn at_particles(formula: &Bound, feet: &FootPoints<D>, time: f64, mut write: impl FnMut(usize, f64)) {
        for from in (0..feet.len()).step_by(BLOCK) {
            let count = BLOCK.min(feet.len() - from);
            let mut columns = [[0.0; BLOCK]; 7];
            for d in 0..D {
                let places = feet.positions[from..from + count].iter().map(|x| x[d]);
                columns[d].iter_mut().zip(places).for_each(|(slot, value)| *slot = value);
                let normals = feet.normals[from..from + count].iter().map(|n| n[d]);
                columns[D + d].iter_mut().zip(normals).for_each(|(slot, value)| *slot = value);
            }
            columns[2 * D][..count].copy_from_slice(&feet.curvatures[from..from + count]);
            let inputs: [Input<'_>; 8] = std::array::from_fn(|k| match columns.get(k) {
                Some(column) if k <= 2 * D => Input::Column(&column[..count]),
                _ => Input::Uniform(time),
            });
            formula.block(&inputs[..2 * D + 2], count, |_, i, value| write(from + i, value));
        }
    }

    /// The variables of particle i.
    fn place(feet: &FootPoints<D>, i: usize, time: f64) -> Vec<f64> {
        let (x, n) = (feet.positions[i], feet.normals[i]);
        x.iter().chain(n.iter()).copied().chain([feet.curvatures[i], time]).collect()
    }

    fn speed_at(&self, feet: &FootPoints<D>, i: usize, time: f64) -> f64 {
        self.speed.at(&Self::place(feet, i, time)).first().copied().unwrap_or(f64::NAN)
    }

    fn top(&self) -> f64 {
        MARGIN * self.found.largest.abs().max(self.found.least.abs())
    }

    fn is_by_curvature(&self) -> bool {
        self.speed.depends_on(2 * D)
    }

    /// Refuses smoothing that the steps were not made for.
    fn check_smoothing(&self, feet: &FootPoints<D>, time: f64) -> Result<(), PathError> {
        if !self.is_by_curvature() {
            return Ok(());
        }
        let (mut most, mut place) = (0.0_f64, 0);
        Self::at_particles(&self.by_curvature, feet, time, |i, slope| {
            if -slope > most || slope > self.found.diffusivity * 1e-6 + 1e-300 {
                (most, place) = (if slope > 0.0 { f64::INFINITY } else { -slope }, i);
            }
        });
        if most <= MORE_SMOOTHING * self.found.diffusivity {
            return Ok(());
        }
        Err(PathError::Undefined(format!(
            "the speed \"{}\" changes with the curvature by {:.3e} at {}, where the steps were made for −{:.3e} to 0",
            self.speed.texts()[0],
            Self::slope_at(&self.by_curvature, feet, place, time),
            shown(&feet.positions[place]),
            self.found.diffusivity
        )))
    }

    fn slope_at(formula: &Bound, feet: &FootPoints<D>, i: usize, time: f64) -> f64 {
        formula.at(&Self::place(feet, i, time)).first().copied().unwrap_or(f64::NAN)
    }
}

/// Variables at places, directions, curvatures and times about a front.
fn samples<const D: usize>(low: &Vector<D>, high: &Vector<D>, end_time: f64) -> Vec<Vec<f64>> {
    let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5 * STRETCH);
    let extent = (high - low).max().max(f64::MIN_POSITIVE);
    let mut all = Vec::new();
    for place in 0..PLACES.pow(D as u32) {
        let node = indices(place, &[PLACES; D]);
        let share = |d: usize| 2.0 * node[d] as f64 / (PLACES - 1) as f64 - 1.0;
        let x = Vector::<D>::from_fn(|d, _| middle[d] + share(d) * half[d]);
        for direction in 0..3_usize.pow(D as u32) {
            let signs = indices(direction, &[3; D]);
            let n = Vector::<D>::from_fn(|d, _| signs[d] as f64 - 1.0);
            let Some(n) = n.try_normalize(0.0) else { continue };
            for bend in [-4.0, 0.0, 4.0] {
                for share in [0.0, 0.37, 1.0] {
                    all.push(x.iter().chain(n.iter()).copied().chain([bend / extent, share * end_time]).collect());
                }
            }
        }
    }
    all
}

impl<const D: usize, const M: usize> FrontLaw<D, M> for FormulaSpeed<D> {
    fn name(&self) -> &'static str {
        if self.is_by_curvature() { "mean_curvature" } else { "normal" }
    }

    fn velocity(&self, feet: &FootPoints<D>, i: usize, time: f64) -> Vector<D> {
        feet.normals[i] * self.speed_at(feet, i, time)
    }

    fn advance(&self, front: &mut MovingFront<'_, D>, step: &MotionStep<'_>) -> Result<f64, PathError> {
        self.check_smoothing(front.feet, step.time)?;
        staged_motion::advance(front, step, |feet, time, velocities| {
            let mut broken = None;
            Self::at_particles(&self.speed, feet, time, |i, speed| {
                velocities[i] = feet.normals[i] * speed;
                if !speed.is_finite() && broken.is_none() {
                    broken = Some(i);
                }
            });
            let Some(i) = broken else { return Ok(()) };
            let fault = self.speed.fault(&Self::place(feet, i, time));
            // A particle that is nowhere is found by the check of positions.
            fault.map_or(Ok(()), |fault| Err(PathError::Undefined(format!("{fault} (the speed of a particle)"))))
        })
    }

    fn normal_displacement(&self, feet: &FootPoints<D>, i: usize, time: f64, step: f64) -> f64 {
        self.speed_at(feet, i, time) * step
    }

    /// Neither way where the speed changes in time: then it is not known here.
    fn facing(&self, feet: &FootPoints<D>, i: usize) -> f64 {
        if self.speed.depends_on(2 * D + 1) { 0.0 } else { self.speed_at(feet, i, 0.0).signum() }
    }

    fn particles_in_bends(&self) -> Option<usize> {
        if self.is_by_curvature() { super::mean_curvature::particles_in_bends::<D>() } else { None }
    }

    /// Corners open towards the sides to which parts of the front move.
    fn opens_corners(&self, signed_distance: f64) -> bool {
        self.is_by_curvature()
            || self.found.largest > 0.0 && signed_distance > 0.0
            || self.found.least < 0.0 && signed_distance < 0.0
    }

    fn rounds_corners_at_once(&self) -> bool {
        self.is_by_curvature()
    }

    fn top_speed(&self, _extent: Option<&(Vector<D>, Vector<D>)>) -> f64 {
        self.top()
    }

    fn default_cfl(&self) -> Option<f64> {
        Some(DEFAULT_CFL)
    }

    fn default_time_step(&self, plan: &StepPlan<D>) -> f64 {
        let by_speed = plan.cfl.unwrap_or(DEFAULT_CFL) * plan.finest / self.top();
        let stable = FrontLaw::<D, M>::longest_step(self, &plan.stability);
        let by_curvature = stable.map_or(f64::INFINITY, |stable| {
            stable.min(DEFAULT_STEP / self.found.diffusivity) * plan.finest * plan.finest
        });
        by_speed.min(by_curvature)
    }

    fn longest_step(&self, stability: &StabilityPlan) -> Option<f64> {
        (self.found.diffusivity > 0.0).then(|| longest_step(stability) / self.found.diffusivity)
    }

    /// Each stage of a step needs reconstructions through all particles, so they take the same steps.
    fn takes_error_control(&self) -> bool {
        false
    }

    /// A front that grows becomes larger as the boxes about its parts do.
    fn stretch(&self, start: &FrontAtStart<D>, _end_time: f64) -> Stretch {
        let growth = |(low, high): (Vector<D>, Vector<D>)| {
            1.0 + 2.0 * self.found.largest.max(0.0) * self.end_time / (high - low).max()
        };
        let largest = start.parts.iter().map(|part| growth(part.bounding_box())).fold(1.0, f64::max);
        let most = largest.powi(D as i32 - 1);
        Stretch { mean: 0.5 * (1.0 + most), most }
    }
}
