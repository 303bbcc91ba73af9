//! What the short runs of `meniscus calibrate` say of a scene, once one level of it is known.
//!
//! Errors of scenes of a kind lie on one curve when spacings go by the length over which a scene varies. The level tells that
//! length: the short runs have its error at a spacing of their own, and the ratio of the two spacings is the ratio of the lengths.
//! Then every set-up of which there are short runs has a spacing with which it would meet the tolerance, and a cost.

use super::Plan;
use super::decision::Setup;
use super::spacing::{SAFETY, Told};
use crate::convergence::{Level, Parabola};
use crate::spec::accuracy::KnownLevel;
use crate::spec::body::{Allowance, BodyError, JobBody, Sources};
use crate::spec::quantity::Quantity;
use crate::spec::study::point_body;
use crate::spec::work_precision::{cost_at, error_scale, reference_of};
use meniscus::scene::Scene;
use meniscus::spec::Json;
use serde_json::Value;

/// Looks up what short runs said of an error, by the name of the runs, the quantity and the norm.
pub type Known<'a, E> = &'a dyn Fn(&str, &str, &str) -> Result<Vec<Level>, E>;

/// Short runs from which on the order may change with the spacing.
const BENT: usize = 5;
/// How far beyond the finest short run a spacing may be told, and beyond the coarsest one.
const BEYOND: (f64, f64) = (3.0, 2.0);
/// How much finer than the level, and how much coarser, the spacing may be that is told.
const FARTHEST: (f64, f64) = (4.0, 2.0);
/// Standard deviation of the logarithm of the length over which a scene varies, by its size, before a level is known.
const LENGTH_DEVIATION: f64 = 0.35;
/// Standard deviations of that logarithm which the predicted error covers: nine of ten runs meet their tolerance.
const CONFIDENCE: f64 = 1.28;
/// Order below which short runs tell nothing.
const LEAST_ORDER: f64 = 0.5;

/// Errors and costs of a set-up over the spacing, both by the size of the scene of the short runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// The short runs, the coarsest first.
    runs: Vec<Level>,
    fit: Parabola,
    /// Standard deviation of the logarithm of errors about the fit.
    scatter: f64,
    /// Largest logarithm of an error by the fit.
    highest: f64,
}

/// A place on a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// The spacing by the size.
    pub spacing: f64,
    /// Order of the errors about there.
    order: f64,
}

impl Curve {
    /// The curve of short runs, the coarsest first: a power law, and from five runs on one whose order changes with the logarithm of
    /// the spacing. None for fewer than two runs with an error.
    #[must_use]
    pub fn new(levels: Vec<Level>) -> Option<Self> {
        let is_usable = |level: &Level| level.value > 0.0 && level.value.is_finite();
        let runs: Vec<Level> = levels.into_iter().filter(is_usable).collect();
        let points: Vec<(f64, f64)> = runs.iter().map(|run| (run.spacing.ln(), run.value.ln())).collect();
        let unknowns = if runs.len() < BENT { 2 } else { 3 };
        let fit = Parabola::through(&points, unknowns)?;
        let above = points.iter().map(|(x, y)| y - fit.at(*x));
        let squares: f64 = above.clone().map(|above| above * above).sum();
        let scatter = (squares / points.len().saturating_sub(unknowns).max(1) as f64).sqrt();
        Some(Self { runs, fit, scatter, highest: above.fold(0.0, f64::max) })
    }

    /// The place with an error; None far beyond the short runs, and where errors hardly fall.
    #[must_use]
    pub fn place(&self, error: f64) -> Option<Place> {
        if !(error > 0.0 && error.is_finite()) {
            return None;
        }
        let (coarsest, finest) = (self.runs.first()?.spacing, self.runs.last()?.spacing);
        let (mut fine, mut coarse) = ((finest / BEYOND.0).ln(), (coarsest * BEYOND.1).ln());
        let excess = |x: f64| self.fit.at(x) - error.ln();
        if excess(fine) > 0.0 || excess(coarse) < 0.0 {
            return None;
        }
        for _ in 0..60 {
            let middle = 0.5 * (fine + coarse);
            if excess(middle) > 0.0 { coarse = middle } else { fine = middle }
        }
        let order = self.fit.slope(fine);
        (order >= LEAST_ORDER).then_some(Place { spacing: fine.exp(), order })
    }

    /// CPU seconds of a short run with a spacing.
    #[must_use]
    pub fn cost(&self, spacing: f64) -> Option<f64> {
        cost_at(&self.runs, spacing)
    }
}

/// The choice that a scene has made among those that it could leave open.
fn choice_of(scene: &dyn Scene, sent: &Json) -> Option<(&'static str, Json)> {
    let made = |(pointer, values): (&'static str, Vec<Json>)| {
        let value = Value::pointer(sent, pointer)?;
        values.contains(value).then(|| (pointer, value.clone()))
    };
    scene.choices().into_iter().find_map(made)
}

/// The curve of the set-up that a body has.
///
/// # Errors
/// A failed look-up.
pub fn curve_of<E>(body: &JobBody, (quantity, norm): (&str, &str), known: Known<'_, E>) -> Result<Option<Curve>, E> {
    let sent = Value::pointer(&body.spec, "/scene").cloned().unwrap_or_default();
    let choice = choice_of(body.scene.as_ref(), &sent);
    let name = reference_of(body.scene.as_ref(), choice.as_ref().map(|(pointer, value)| (*pointer, value)));
    Ok(Curve::new(known(&name, quantity, norm)?))
}

/// The curves of the set-ups of a plan, and what errors are divided by to stand on them.
#[derive(Debug, Clone)]
pub struct Curves {
    by_setup: Vec<Option<Curve>>,
    /// The length that spacings go by.
    size: f64,
    /// The error that errors go by.
    error_scale: f64,
}

impl Curves {
    /// Those of a plan over its base; None where its quantity or its scene has none.
    ///
    /// # Errors
    /// A failed look-up.
    pub fn of_plan<S: Sources>(
        plan: &Plan,
        base: &Json,
        allowance: Allowance,
        sources: &S,
        known: Known<'_, S::Error>,
    ) -> Result<Option<Self>, BodyError<S::Error>> {
        let Quantity::Error { quantity, norm, time: None } = &plan.quantity else { return Ok(None) };
        if plan.spec.until.relative {
            return Ok(None);
        }
        let (mut by_setup, mut scales) = (Vec::new(), None);
        for setup in &plan.setups {
            let body = match point_body(base, &plan.spec.point(base, setup, 0), allowance, sources) {
                Ok(body) => body,
                Err(BodyError::Invalid(_)) => {
                    by_setup.push(None);
                    continue;
                }
                Err(error) => return Err(error),
            };
            let size = body.scene.size();
            scales = scales.or(size.map(|size| (size, error_scale(body.scene.as_ref(), quantity, size))));
            by_setup.push(curve_of(&body, (quantity, norm), known).map_err(BodyError::Lookup)?);
        }
        Ok(scales.map(|(size, error_scale)| Self { by_setup, size, error_scale }))
    }
}

/// What short runs tell of a job.
#[derive(Debug, Clone, PartialEq)]
pub struct Foretold {
    /// Number of the set-up that reaches the tolerance at the least cost.
    pub setup: usize,
    /// Its spacing.
    pub told: Told,
    /// What that rests on, the coarsest first: the levels of the set-up, and the short runs as they would be in this scene.
    pub levels: Vec<KnownLevel>,
}

/// The set-up and the spacing that the first level of a study tells, with the short runs; None where these do not reach so far.
#[must_use]
pub fn tell(plan: &Plan, setups: &[Setup], curves: &Curves) -> Option<Foretold> {
    let curve = |setup: usize| curves.by_setup.get(setup)?.as_ref();
    let known = |number: usize| {
        let (setup, curve) = (&setups[number], curve(number)?);
        let level = setup.levels.last()?;
        let place = curve.place(level.value / curves.error_scale)?;
        let deviation = curve.scatter / place.order;
        Some((level.spacing, level.spacing / setup.finest_share(plan.spec.ratio), (place.spacing, deviation)))
    };
    let (level_spacing, first_spacing, (pilot, told_deviation)) = (0..setups.len()).find_map(known)?;
    let Length { length, deviation } = Length::by(level_spacing / pilot, told_deviation, curves.size);
    let tolerance = plan.spec.until.tolerance;
    let told = |number: usize| {
        let curve = curve(number).filter(|_| setups[number].obstacle.is_none())?;
        let about = curve.place(tolerance / curves.error_scale)?;
        let margin = curve.highest.hypot(CONFIDENCE * deviation * about.order).exp();
        let goal = tolerance / SAFETY / margin;
        let place = curve.place(goal / curves.error_scale)?;
        let spacing = length * place.spacing;
        let is_near = spacing * FARTHEST.0 >= level_spacing && spacing <= level_spacing * FARTHEST.1;
        let told = Told { share: spacing / first_spacing, predicted: goal };
        is_near.then_some((curve.cost(place.spacing)?, number, told))
    };
    let (_, setup, told) = (0..setups.len()).filter_map(told).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let as_here = |run: &Level| KnownLevel {
        spacing: run.spacing * length,
        value: run.value * curves.error_scale,
        cpu_s: run.cpu_s,
    };
    let short_runs = curve(setup)?.runs.iter().map(as_here);
    let mut levels: Vec<KnownLevel> = short_runs.chain(setups[setup].levels.iter().map(KnownLevel::from)).collect();
    levels.sort_by(|a, b| b.spacing.total_cmp(&a.spacing));
    Some(Foretold { setup, told, levels })
}

/// The length over which a scene varies.
struct Length {
    length: f64,
    /// Standard deviation of its logarithm.
    deviation: f64,
}

impl Length {
    /// The mean of the length that a level tells, whose logarithm has a deviation, and of the size of the scene: where errors scatter
    /// a single level says little.
    fn by(told: f64, deviation: f64, size: f64) -> Self {
        let (of_level, of_size) = (deviation.max(1e-3).powi(-2), LENGTH_DEVIATION.powi(-2));
        let mean = (of_level * told.ln() + of_size * size.ln()) / (of_level + of_size);
        Self { length: mean.exp(), deviation: (of_level + of_size).sqrt().recip() }
    }
}

#[cfg(test)]
mod tests {
    use super::{Curve, Curves, tell};
    use crate::convergence::Level;
    use crate::refinement::Plan;
    use crate::refinement::decision::Setup;
    use crate::spec::study::MeasuredLevel;
    use serde_json::json;

    fn curve(order: f64, work: f64, noise: f64) -> Curve {
        let level = |(k, h): (usize, f64)| {
            let off = if k.is_multiple_of(2) { noise } else { -noise };
            Level { spacing: h, value: h.powf(order) * off.exp(), cpu_s: work * h.powi(-2) }
        };
        Curve::new([0.4, 0.28, 0.2, 0.14, 0.1].into_iter().enumerate().map(level).collect()).unwrap()
    }

    fn plan(tolerance: f64) -> Plan {
        let sweep = json!({"mode": "refine", "axis": "/scene/spacing", "from": 0.05, "ratio": 1.4, "levels": {"least": 3, "most": 10},
            "alternatives": {"/scene/method/degree": [3, 5]},
            "quantity": {"error": {"quantity": "phi", "norm": "rms"}}, "until": {"tolerance": tolerance}});
        Plan::new(&sweep, &json!({"scene": {"kind": "redistance"}})).unwrap()
    }

    #[test]
    fn a_curve_tells_the_spacing_of_an_error_between_its_runs_and_beyond_them() {
        for spacing in [0.3, 0.15, 0.05_f64] {
            let place = curve(3.0, 1.0, 0.0).place(spacing.powi(3)).unwrap();
            assert!((place.spacing / spacing - 1.0).abs() < 1e-9 && (place.order - 3.0).abs() < 1e-9, "{place:?}");
            assert!((curve(3.0, 2.0, 0.0).cost(spacing).unwrap() * spacing.powi(2) / 2.0 - 1.0).abs() < 1e-9);
        }
        assert!(curve(3.0, 1.0, 0.0).place(1e-9).is_none(), "far beyond");
        for error in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(curve(3.0, 1.0, 0.0).place(error).is_none(), "{error}");
        }
        assert!(curve(0.0, 1.0, 0.0).place(0.5).is_none(), "no order");
        assert!(curve(3.0, 1.0, 0.3).scatter > 0.2 && curve(3.0, 1.0, 0.0).scatter < 1e-9);
        let level = Level { spacing: 0.1, value: f64::NAN, cpu_s: 1.0 };
        assert!(Curve::new(vec![level, level]).is_none());
    }

    /// A scene whose length is a quarter of that of the short runs, with one level of order 4.
    fn setups(first: f64) -> [Setup; 2] {
        let level = MeasuredLevel::of_error(Level { spacing: first, value: (4.0 * first).powi(4), cpu_s: 0.1 }, None);
        [Setup { levels: vec![level], ..Setup::default() }, Setup::default()]
    }

    #[test]
    fn one_level_tells_the_spacing_of_every_set_up() {
        let curves = Curves {
            by_setup: vec![Some(curve(4.0, 1.0, 0.0)), Some(curve(6.0, 1.5, 0.0))],
            size: 0.25,
            error_scale: 1.0,
        };
        // Order 4 is cheaper where little is asked for, order 6 where much is.
        for (tolerance, setup, order) in [(1e-2, 0, 4), (1e-5, 1, 6)] {
            let found = tell(&plan(tolerance), &setups(0.05), &curves).unwrap();
            assert_eq!((found.setup, found.levels.len()), (setup, 6 - setup));
            let reached = (4.0 * 0.05 * found.told.share).powi(order);
            assert!(reached <= tolerance && reached > 0.7 * tolerance, "{reached} for {tolerance}");
        }
        assert!(tell(&plan(1e-2), &[Setup::default(), Setup::default()], &curves).is_none(), "no level is known");
        assert!(tell(&plan(1e-13), &setups(0.05), &curves).is_none(), "beyond the short runs");
    }

    #[test]
    fn where_errors_scatter_the_spacing_is_finer() {
        let told = |noise: f64| {
            let curves = Curves { by_setup: vec![Some(curve(4.0, 1.0, noise)), None], size: 0.25, error_scale: 1.0 };
            tell(&plan(1e-3), &setups(0.05), &curves).unwrap().told
        };
        let (smooth, rough) = (told(0.0), told(0.5));
        assert!(rough.predicted < smooth.predicted / 1.5 && rough.share < 0.9 * smooth.share, "{smooth:?} {rough:?}");
    }
}
