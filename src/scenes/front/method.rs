//! The method and the time steps of a front.

use super::choice::{Completed, FrontChoice, FrontPlan, Resolved};
use crate::geometry::Vector;
use crate::scenes::gbpm_spec::{GbpmContext, GbpmPlan, TopologyWord};
use crate::schemes::grid_based_particle::curvature_stability::StabilityPlan;
use crate::schemes::grid_based_particle::laws::StepPlan;
use crate::schemes::grid_based_particle::{FrontLaw, Grid};
use crate::spec::Violation;
use crate::time::{FixedStep, PathIntegrator};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Resident bytes of a foot point: its columns twice, its outcome, cells, a frame and a checkpoint in the making.
pub(super) const BYTES: u64 = 1200;
/// The same on a refined grid, with the cells that are split in the making.
pub(super) const REFINED_BYTES: u64 = 5000;
/// Largest number of steps.
const MOST_STEPS: u64 = 1_000_000_000;

/// What the method and the time steps of a front in D dimensions depend on beside its parameters.
pub(super) struct FrontQuestion<'a, const D: usize, const M: usize> {
    /// The law; None where it does not exist in this dimension, which is a violation already.
    pub law: Option<&'a dyn FrontLaw<D, M>>,
    /// The box about the front at the start, where its shape is known.
    pub extent: Option<(Vector<D>, Vector<D>)>,
    /// Dimension of the scene.
    pub dimension: usize,
    /// Whether the grid with some number of levels reaches around the front.
    pub is_within_grid: &'a dyn Fn(u32) -> bool,
}

/// Plans the method and the time steps; `complete` writes what was left open into the spec of the scene.
///
/// # Errors
/// All violations, those found before included.
pub(super) fn plan_method<const D: usize, const M: usize>(
    choice: &FrontChoice,
    front: &FrontQuestion<'_, D, M>,
    complete: impl FnOnce(Completed) -> Resolved,
    mut errors: Vec<Violation>,
) -> Result<FrontPlan, Vec<Violation>> {
    let (dimension, motion) = (front.dimension, choice.law.motion());
    let topology = choice.topology.unwrap_or(TopologyWord::Merge);
    let context = GbpmContext { pointer: choice.pointer, dimension, motion, topology };
    let planned = choice.method.clone().plan(context);
    check_steps(choice, front.law, &mut errors);
    let is_unread = front.extent.is_none() && choice.shape.is_from_outside();
    if is_unread && choice.law.depends_on_place() || choice.law.is_from_outside() {
        errors.extend(check_step_of_data(choice));
    }
    if !(front.is_within_grid)(choice.method.levels()) {
        let detail = "the grid ends before the shape does: its finest level counts so many cells from the origin alone";
        errors.push(Violation::new("/spacing", "range", detail, choice.spacing, json!("a larger number")));
    }
    let steps = step_plan(choice, dimension, front.extent);
    let fixed = fixed_step(choice, front.law, &steps);
    errors.extend(check_stability(choice, front.law, fixed, &steps));
    if !fixed.time_step.is_normal() || fixed.steps == 0 || fixed.steps > MOST_STEPS {
        let allowed = format!("a number from {} to {}", choice.end_time * 1e-9, choice.end_time);
        let detail = "the run would have too many steps or none";
        errors.push(Violation::new("/time_step", "range", detail, json!(fixed.time_step), allowed));
    }
    let (chosen, method) = match planned {
        Ok(planned) if errors.is_empty() => planned,
        Ok(_) => return Err(errors),
        Err(found) => {
            errors.extend(found);
            return Err(errors);
        }
    };
    let resolved = complete(Completed { dimension, time_step: fixed.time_step, method });
    Ok(FrontPlan { resolved, chosen, fixed })
}

/// What time steps of a front in a box depend on beside its law.
pub(super) fn step_plan<const D: usize>(
    choice: &FrontChoice,
    dimension: usize,
    extent: Option<(Vector<D>, Vector<D>)>,
) -> StepPlan<D> {
    let (method, motion) = (&choice.method, choice.law.motion());
    let finest = Grid { spacing: choice.spacing }.spacing_at(method.levels() - 1);
    let (degree, weight) = (method.degree_for(dimension, motion), method.weight_for(dimension, motion));
    let stability = StabilityPlan { integrator: choice.integrator, dimension, degree, weight };
    StepPlan { finest, cfl: method.cfl, extent, stability }
}

/// Violations where an integrator or a way to give the step does not go with the law, or where a step is given twice.
fn check_steps<const D: usize, const M: usize>(
    choice: &FrontChoice,
    law: Option<&dyn FrontLaw<D, M>>,
    errors: &mut Vec<Violation>,
) {
    let cfl = choice.method.cfl;
    if law.is_some_and(|law| !law.takes_error_control())
        && let PathIntegrator::Dopri5 { .. } = choice.integrator
    {
        let detail = "error control is for prescribed flows";
        errors.push(Violation::new("/integrator/type", "conflict", detail, "dopri5", json!(["rk4", "tvd_rk2"])));
    }
    let given = [cfl.is_some(), choice.time_step.is_some(), choice.steps.is_some()];
    if given.iter().filter(|is_given| **is_given).count() > 1 {
        let detail = "a step is given in more than one way; give one of cfl, time_step and steps";
        let at = if cfl.is_some() { format!("{}/cfl", choice.pointer) } else { "/time_step".to_owned() };
        errors.push(Violation::new(at, "conflict", detail, json!(cfl.or(choice.time_step)), Value::Null));
    }
    if law.is_some_and(|law| law.default_cfl().is_none())
        && let Some(cfl) = cfl
    {
        let detail = "motion by curvature has no speed to measure a step by; give time_step";
        errors.push(Violation::new("/cfl", "conflict", detail, cfl, Value::Null));
    }
}

/// The violation where a step is left open whose length would follow from what is in a file.
fn check_step_of_data(choice: &FrontChoice) -> Option<Violation> {
    let is_open = choice.time_step.is_none() && choice.steps.is_none();
    let detail = "how fast a front moves is not known before its mesh or flow is read; give time_step or steps";
    is_open.then(|| Violation::new("/time_step", "required", detail, Value::Null, "a number > 0"))
}

/// The violation of a step that is longer than a stable one.
pub(super) fn check_stability<const D: usize, const M: usize>(
    choice: &FrontChoice,
    law: Option<&dyn FrontLaw<D, M>>,
    fixed: FixedStep,
    steps: &StepPlan<D>,
) -> Option<Violation> {
    let factor = law?.longest_step(&steps.stability)?;
    let longest = factor * steps.finest * steps.finest;
    let step = Some(choice.time_step.unwrap_or(fixed.time_step)).filter(|step| *step > longest)?;
    let at = if choice.steps.is_some() { "/steps" } else { "/time_step" };
    let detail = format!("motion by curvature is unstable with steps longer than {factor:.3} h² (of the finest level)");
    Some(Violation::new(at, "range", detail, step, format!("a time step ≤ {longest:e}")))
}

/// The time step, as given or by the default of the law.
fn fixed_step<const D: usize, const M: usize>(
    choice: &FrontChoice,
    law: Option<&dyn FrontLaw<D, M>>,
    steps: &StepPlan<D>,
) -> FixedStep {
    match (choice.time_step, choice.steps) {
        (Some(step), _) => FixedStep::from_time_step(choice.end_time, step),
        (None, Some(steps)) => FixedStep::from_steps(choice.end_time, steps),
        (None, None) => {
            let limit = law.map_or(f64::INFINITY, |law| law.default_time_step(steps));
            let period = law.and_then(FrontLaw::return_time);
            landing_on_turns(FixedStep::from_limit(choice.end_time, limit), choice.end_time, period)
        }
    }
}

/// A few more steps where the end is a whole number of half periods, so that each of these ends a step: errors are
/// due there.
fn landing_on_turns(fixed: FixedStep, end_time: f64, turn: Option<f64>) -> FixedStep {
    let halves = turn.map_or(0.0, |turn| 2.0 * end_time / turn);
    let is_whole = (halves - halves.round()).abs() < 1e-9 && halves >= 1.0 && halves < fixed.steps as f64;
    let is_whole = is_whole && fixed.steps <= MOST_STEPS;
    if !is_whole {
        return fixed;
    }
    FixedStep::from_steps(end_time, fixed.steps.next_multiple_of(halves.round() as u64))
}

/// Whether a grid reaches around a box: with three levels more, for lattices that are finer still.
pub(super) fn is_within_grid<const D: usize>((low, high): (Vector<D>, Vector<D>), spacing: f64, levels: u32) -> bool {
    let grid = Grid { spacing };
    let margin = 8.0 * spacing;
    [low.add_scalar(-margin), high.add_scalar(margin)].iter().all(|x| grid.nearest(x, levels + 2).is_some())
}

/// Method, step and refinement in words, for the report. `in_bends` is the number of particles of the quadratics in sharp
/// bends, where the law has these.
pub(super) fn labels(chosen: &GbpmPlan, fixed: FixedStep, in_bends: Option<usize>) -> BTreeMap<&'static str, String> {
    let method = &chosen.method;
    let mut reconstruction = format!(
        "degree {}, {} particles, weight {}, that of normals {}, normals to {}",
        method.degree, method.neighbors, method.weight, method.normal_weight, method.cosine
    );
    if let Some(number) = in_bends.filter(|_| method.degree > 2) {
        reconstruction += &format!("; in sharp bends degree 2, {number} particles");
    }
    let step = format!("{}", fixed.time_step);
    let mut labels = BTreeMap::from([("reconstruction", reconstruction), ("time_step", step)]);
    if let Some(adaptivity) = method.adaptivity {
        let levels = format!("{} levels where |κ| h ≥ {}", adaptivity.levels, adaptivity.curvature_constant);
        labels.insert("adaptivity", levels);
    }
    labels
}

#[cfg(test)]
mod tests {
    use super::{FixedStep, is_within_grid, landing_on_turns};
    use crate::geometry::Vector;

    #[test]
    fn half_periods_end_at_steps() {
        let fixed = FixedStep::from_steps(8.0, 33);
        assert_eq!(landing_on_turns(fixed, 8.0, Some(8.0)).steps, 34);
        assert_eq!(landing_on_turns(fixed, 8.0, Some(4.0)).steps, 36);
        // Where the end is no whole number of half periods, and without a period, nothing changes.
        assert_eq!(landing_on_turns(fixed, 8.0, Some(3.0)).steps, 33);
        assert_eq!(landing_on_turns(fixed, 8.0, None).steps, 33);
    }

    #[test]
    fn the_grid_ends_where_its_numbers_do() {
        let unit = (Vector::<3>::zeros(), Vector::<3>::repeat(1.0));
        assert!(is_within_grid(unit, 1e-3, 1) && !is_within_grid(unit, 1e-7, 1));
        assert!(is_within_grid(unit, 1e-4, 1) && !is_within_grid(unit, 1e-4, 5));
    }
}
