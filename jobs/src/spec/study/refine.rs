//! Studies that refine: levels, each finer than the one before by a ratio, until a quantity is known to a tolerance.

use super::axes::{Axes, Pointer, SweepPoint};
use super::{Found, Total, point_body};
use crate::spec::body::{Allowance, BodyError, JobBody, JobSpec, Sources};
use crate::spec::calibration::Calibration;
use crate::spec::quantity::{Quantity, QuantitySpec};
use meniscus::scenes::kind_of;
use meniscus::spec::{Given, Interval, Json, Object, POSITIVE, Parameter, Violation, Word, escape, whole};
use serde_json::{Map, Value, json};

/// Levels of a set-up at most.
pub const MOST_LEVELS: u64 = 12;
/// Set-ups that are compared at most.
pub const MOST_SETUPS: usize = 16;

meniscus::words! {
    /// How a value follows the spacing.
    pub enum Follows {
        /// in proportion to it
        Proportional = "proportional",
    }
}

meniscus::group! {
    /// How many levels are made.
    pub struct LevelsSpec: Default {
        /// levels that are made in any case
        least: u64 = 3, in whole(2, MOST_LEVELS);
        /// levels of the set-up that goes on, at most
        most: u64 = 6, in whole(2, MOST_LEVELS);
    }
}

meniscus::group! {
    /// When the levels are fine enough.
    pub struct UntilSpec {
        /// bound of the error, or of the grid convergence index of a value
        tolerance: f64, in POSITIVE;
        /// whether it is a share of the quantity
        relative: bool = false;
    }
}

meniscus::group! {
    /// What all levels together may cost.
    pub struct BudgetSpec {
        /// CPU seconds; a level whose predicted cost is beyond them is not made
        cpu_s: f64, in POSITIVE;
    }
}

/// Ratios of the spacings of two levels.
const RATIOS: Interval = Interval::at_least(1.1).and_at_most(10.0);

meniscus::group! {
    /// Levels of refinement.
    pub struct RefineSpec {
        /// JSON pointer into the job's body to a spacing, or to a `count` of points, whose spacing goes as count^(−1/2)
        axis: Pointer;
        /// value of the axis at the first level
        from: f64, in POSITIVE;
        /// ratio of the spacings of two levels, one after the other
        ratio: f64 = 1.5, in RATIOS;
        /// how many levels are made
        levels: LevelsSpec = LevelsSpec::default();
        /// values that follow the spacing, by JSON pointers; `base` has those of the first level
        with: Option<Followers>;
        /// what is judged
        quantity: QuantitySpec;
        /// when the levels are fine enough
        until: UntilSpec;
        /// what all levels together may cost
        budget: Option<BudgetSpec>;
        /// lists of values by JSON pointers: every combination is tried on the first levels, and the cheapest goes on
        alternatives: Option<Axes>;
        /// whether levels are taken from equal earlier jobs
        reuse: bool = true;
    }
}

/// Values that follow the spacing, by pointer.
#[derive(Debug, Clone, PartialEq)]
pub struct Followers(Vec<(String, Follows)>);

impl Parameter for Followers {
    type Domain = ();

    fn any() {}

    fn parse(given: &Json, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let Some(map) = given.as_object() else {
            let detail = "an object from JSON pointers to how a value follows the spacing is needed";
            errors.push(Violation::new(place, "type", detail, given.clone(), Self::allowed(())));
            return None;
        };
        let mut followers = Vec::new();
        for (pointer, word) in map {
            let at = format!("{place}/{}", escape(pointer));
            let pointer = Pointer::parse(&json!(pointer), (), &at, errors);
            let follows = Follows::parse(word, (), &at, errors);
            followers.push(pointer.zip(follows).map(|(pointer, follows)| (pointer.0, follows)));
        }
        followers.into_iter().collect::<Option<Vec<_>>>().map(Self)
    }

    fn allowed((): ()) -> Json {
        json!({"/scene/time_step": Follows::Proportional.word()})
    }

    fn schema((): ()) -> Object {
        Map::from_iter([
            ("type".to_owned(), json!("object")),
            ("additionalProperties".to_owned(), Json::Object(Follows::schema(()))),
        ])
    }

    fn to_json(&self) -> Json {
        Json::Object(self.0.iter().map(|(pointer, follows)| (pointer.clone(), json!(follows.word()))).collect())
    }
}

impl RefineSpec {
    /// What is wrong beyond single fields; `base` is the body that the levels share.
    pub fn check(&self, base: &Json, errors: &mut Vec<Violation>) {
        let LevelsSpec { least, most } = self.levels;
        if least > most {
            let detail = format!("at least {least} levels are more than at most {most}");
            errors.push(Violation::new("/sweep/levels/least", "conflict", detail, least, format!("≤ {most}")));
        }
        let setups = self.setups().len();
        if setups > MOST_SETUPS {
            let detail = format!("at most {MOST_SETUPS} set-ups are compared");
            errors.push(Violation::new("/sweep/alternatives", "range", detail, setups, MOST_SETUPS));
        }
        for (pointer, _) in self.followers() {
            if first_value(base, pointer).is_none() {
                let at = format!("/sweep/with/{}", escape(pointer));
                let detail = "base must have the value of the first level here, a number";
                let got = Value::pointer(base, pointer).cloned().unwrap_or_default();
                errors.push(Violation::new(at, "required", detail, got, "a number in base"));
            }
        }
        let judged = self.judged(base, errors);
        errors.extend(judged.and_then(|judged| judged.check_relative(self.until.relative, "/sweep/until/relative")));
        if base.as_object().is_some_and(|body| Given::new(body).has(JobSpec::restart())) {
            let detail = "levels have spacings of their own, so none of them can begin with a checkpoint";
            errors.push(Violation::new("/base/restart", "conflict", detail, Value::Null, "a scene"));
        }
    }

    /// What is judged.
    pub fn judged(&self, base: &Json, errors: &mut Vec<Violation>) -> Option<Quantity> {
        let scene = base.as_object().map(|body| Given::new(body).raw(JobSpec::scene())).unwrap_or_default();
        self.quantity.resolve(kind_of(&scene), "/sweep/quantity", errors)
    }

    fn followers(&self) -> &[(String, Follows)] {
        self.with.as_ref().map_or(&[], |with| &with.0)
    }

    /// The pointers that vary.
    #[must_use]
    pub fn axes(&self) -> Vec<String> {
        let followers = self.followers().iter().map(|(pointer, _)| pointer.clone());
        let alternatives = self.alternatives.iter().flat_map(Axes::pointers).map(str::to_owned);
        std::iter::once(self.axis.0.clone()).chain(followers).chain(alternatives).collect()
    }

    /// The set-ups that are compared: one where there are no alternatives.
    #[must_use]
    pub fn setups(&self) -> Vec<SweepPoint> {
        let none = SweepPoint { values: Vec::new(), places: Vec::new() };
        self.alternatives.as_ref().map_or_else(|| vec![none], |axes| axes.grid("/sweep/alternatives", MOST_SETUPS + 1))
    }

    /// Number of levels of all set-ups at most: of all but one the first ones alone are made.
    #[must_use]
    pub fn most_levels(&self) -> u64 {
        (self.setups().len().max(1) as u64 - 1) * self.levels.least + self.levels.most
    }

    /// The value of the axis at a spacing, by that of the first level.
    #[must_use]
    pub fn axis_at(&self, share: f64) -> Json {
        if self.axis.0.ends_with("/count") {
            json!((self.from / (share * share)).round() as u64)
        } else {
            json!(self.from * share)
        }
    }

    /// A level of a set-up.
    #[must_use]
    pub fn point(&self, base: &Json, setup: &SweepPoint, level: u64) -> SweepPoint {
        self.point_at(base, setup, self.ratio.powf(-(level as f64)))
    }

    /// A set-up at a spacing, by that of the first level.
    #[must_use]
    pub fn point_at(&self, base: &Json, setup: &SweepPoint, share: f64) -> SweepPoint {
        let mut point = setup.clone();
        let mut add = |pointer: &str, value: Json, place: String| {
            point.values.push((pointer.to_owned(), value));
            point.places.push(place);
        };
        add(&self.axis.0, self.axis_at(share), "/sweep/axis".to_owned());
        for (pointer, Follows::Proportional) in self.followers() {
            let first = first_value(base, pointer).unwrap_or_default();
            add(pointer, json!(first * share), format!("/sweep/with/{}", escape(pointer)));
        }
        point
    }
}

/// The number of the first level that the base has at a pointer of the client's.
fn first_value(base: &Json, pointer: &str) -> Option<f64> {
    Value::pointer(base, pointer).and_then(Value::as_f64)
}

/// What the levels are that are made in any case.
pub(super) struct Levels {
    /// The points of all levels that may be made, set-up by set-up.
    pub(super) points: Vec<SweepPoint>,
    /// Number of levels that are made in any case.
    pub(super) sure: usize,
    /// What those will take.
    pub(super) total: Total,
}

/// Checks the bodies of all levels that may be made. Memory is no question for levels that need not be made: a study ends before
/// them.
///
/// # Errors
/// All violations at once, or a failed look-up.
pub(super) fn check_levels<S: Sources>(
    spec: &RefineSpec,
    base: &Json,
    (allowance, sources): (Allowance, &S),
    calibration: &Calibration,
) -> Result<Levels, BodyError<S::Error>> {
    let mut errors = Vec::new();
    spec.check(base, &mut errors);
    let mut found = Found::default();
    let mut levels = Levels { points: Vec::new(), sure: 0, total: Total { cpu_s: Some(0.0), ..Total::default() } };
    for setup in spec.setups().into_iter().take(MOST_SETUPS) {
        let mut before = None;
        for level in 0..spec.levels.most {
            let is_sure = level < spec.levels.least;
            let point = spec.point(base, &setup, level);
            match point_body(base, &point, allowance, sources) {
                Ok(mut body) => {
                    let spacing = body.scene.spacing();
                    if let Some(violation) = check_spacing(spec, level, spacing, before) {
                        found.add_one(violation);
                    }
                    before = spacing;
                    if is_sure {
                        body.forecast.time_by(calibration);
                        levels.sure += 1;
                        levels.total.add(&body);
                    }
                }
                Err(BodyError::Invalid(violations)) => {
                    let counts = |violation: &Violation| is_sure || violation.code != "memory";
                    found.add(&point, violations.into_iter().filter(counts).collect());
                }
                Err(error) => return Err(error),
            }
            levels.points.push(point);
        }
    }
    errors.extend(found.listed());
    if errors.is_empty() { Ok(levels) } else { Err(errors.into()) }
}

/// An error where the spacing of the scene does not follow the axis.
fn check_spacing(spec: &RefineSpec, level: u64, spacing: Option<f64>, before: Option<f64>) -> Option<Violation> {
    let error = |code, detail: String| {
        let allowed = "the pointer of the spacing, or of the count of points of a surface";
        Some(Violation::new("/sweep/axis", code, detail, spec.axis.0.as_str(), allowed))
    };
    match (spacing, before) {
        (None, _) => error("conflict", "the spacing of this scene is not known before it runs".to_owned()),
        (Some(now), Some(before)) if now >= before => error(
            "conflict",
            format!(
                "the spacing of the scene does not fall from level {} ({before}) to level {level} ({now})",
                level - 1
            ),
        ),
        _ => None,
    }
}

impl Total {
    /// Adds what a job will take.
    pub(super) fn add(&mut self, body: &JobBody) {
        let time = body.forecast.time.as_ref().map(|time| time.cpu_s);
        self.cpu_s = self.cpu_s.zip(time).map(|(a, b)| a + b);
        self.memory_bytes = self.memory_bytes.max(body.forecast.memory_bytes);
        self.disk_bytes = self.disk_bytes.saturating_add(body.forecast.disk_bytes);
    }
}
