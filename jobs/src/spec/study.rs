//! Studies: a base body and a sweep over it.
//!
//! `{"base": {job body}, "sweep": {"mode": "grid" | "zip" | "list", "axes": {POINTER: [values]} | "points": [{POINTER:
//! value}]}, "max_parallel", "on_failure": "continue" | "stop", "name", "labels"}`. Pointers start at the job's body. With the mode
//! `refine` the points are levels that come one after another ([`refine`]).

mod axes;
pub mod level;
pub mod refine;
mod sweep;

pub use axes::{Axes, Pointer, SweepPoint};
pub use level::{MeasuredLevel, RefinementOutcome, RefinementState};
pub use refine::RefineSpec;
pub use sweep::{MOST_POINTS, Points, Sweep};

use crate::spec::body::{self, Allowance, BodyError, JobBody, Labels, Name, Sources};
use crate::spec::calibration::Calibration;
use meniscus::spec::{Given, Group, Json, Raw, Violation, Word, group, whole};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::{BTreeMap, HashSet};

meniscus::words! {
    /// What to do when a point fails.
    pub enum OnFailure {
        /// The other points go on.
        Continue = "continue",
        /// No further point starts.
        Stop = "stop",
    }
}

meniscus::group! {
    /// A study.
    pub struct StudySpec {
        /// a job body that the points share
        base: Raw = Raw::default();
        /// the points
        sweep: Sweep;
        /// number of jobs of the study that may run at once
        max_parallel: Option<u64>, in whole(1, 1_000_000);
        /// what to do when a point fails
        on_failure: Option<OnFailure>;
        /// name, for people
        name: Option<Name>;
        /// labels, for filters
        labels: Option<Labels>;
    }
}

/// Pointers that vary at most.
const MOST_AXES: usize = 64;
/// Bytes of a base body at most: ten thousand copies are made of it.
const LARGEST_BODY: usize = 64 << 10;
/// Violations that are listed at most; the rest is counted.
const MOST_VIOLATIONS: usize = 100;

/// What all points of a study will take together.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Total {
    /// CPU seconds, where all points could be judged.
    pub cpu_s: Option<f64>,
    /// Largest memory of a point, in bytes.
    pub memory_bytes: u64,
    /// Size of all files, in bytes.
    pub disk_bytes: u64,
}

impl Total {
    /// The forecast of a number of points, `at_once` of which run side by side.
    #[must_use]
    pub fn forecast(self, points: usize, at_once: usize) -> StudyForecast {
        let at_once = at_once.clamp(1, points.max(1)) as f64;
        StudyForecast {
            points: points as u64,
            cpu_s: self.cpu_s,
            wall_s: self.cpu_s.map(|cpu_s| cpu_s / at_once),
            memory_bytes: self.memory_bytes,
            disk_bytes: self.disk_bytes,
        }
    }
}

/// What a study will take, as it stands in the store and in answers.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StudyForecast {
    /// Number of points.
    pub points: u64,
    /// CPU seconds of all points, if they can be estimated.
    pub cpu_s: Option<f64>,
    /// Running time in seconds with as many jobs at once as may run.
    pub wall_s: Option<f64>,
    /// Largest memory of a point, in bytes.
    pub memory_bytes: u64,
    /// Size of all files, in bytes.
    pub disk_bytes: u64,
}

/// A valid study; `J` is what is kept of the body of each point.
pub struct Study<J> {
    /// Name, for people.
    pub name: Option<String>,
    /// Labels, for filters.
    pub labels: BTreeMap<String, String>,
    /// Body that all points share.
    pub base: Json,
    /// The sweep as sent.
    pub sweep: Json,
    /// Pointers that vary, in the order in which they first occur.
    pub axes: Vec<String>,
    /// Number of jobs at once at most.
    pub max_parallel: Option<u64>,
    /// `continue` or `stop`.
    pub on_failure: &'static str,
    /// The values of every point by pointer.
    pub points: Vec<Json>,
    /// What is kept of the body of each point; of a study that refines nothing, since its levels come one after another.
    pub jobs: Vec<J>,
    /// How far it may go, where it refines.
    pub refines: Option<Refines>,
    /// What all points will take; of a study that refines the levels that are made in any case.
    pub total: Total,
    /// What the study will take.
    pub forecast: StudyForecast,
}

/// How far a study that refines may go.
#[derive(Debug, Clone, Copy)]
pub struct Refines {
    /// What a level may ask for.
    pub allowance: Allowance,
    /// Number of levels of all set-ups at most.
    pub most_levels: u64,
}

/// From a client's JSON to a study; `slots` jobs run at once, `keep` makes of each body what is needed later.
///
/// # Errors
/// All violations at once (the first hundred of them), or a failed look-up; nothing is made then. A violation at an axis' pointer is reported
/// once, at the axis' value.
pub fn parse<J, S: Sources>(
    spec: &Value,
    allowance: Allowance,
    slots: usize,
    sources: &S,
    calibration: &Calibration,
    keep: impl Fn(&JobBody) -> J,
) -> Result<Study<J>, BodyError<S::Error>> {
    let Value::Object(object) = spec else {
        return Err(vec![Violation::new("", "type", "a study is an object", spec.clone(), StudySpec::names())].into());
    };
    let mut errors = Vec::new();
    group::check_names(object, &StudySpec::names(), "", &mut errors);
    let parsed = StudySpec::parse_fields(object, "", &mut errors);
    let given = Given::new(object);
    let base = given.read(StudySpec::base()).and_then(|base| base.0);
    check_base(base.as_ref(), &mut errors);
    let (Some(parsed), Some(base), true) = (parsed, base, errors.is_empty()) else {
        return Err(errors.into());
    };
    let Swept { points, axes, jobs, total, count } =
        swept(&parsed.sweep, &base, (allowance, sources), calibration, keep)?;
    let refines = match &parsed.sweep {
        Sweep::Refine { refine } => Some(Refines { allowance, most_levels: refine.most_levels() }),
        _ => None,
    };
    let at_once = parsed.max_parallel.map_or(slots, |most| slots.min(most as usize));
    let at_once = if refines.is_some() { 1 } else { at_once };
    Ok(Study {
        name: parsed.name.map(|name| name.0),
        labels: parsed.labels.map(|labels| labels.0).unwrap_or_default(),
        base,
        sweep: given.raw(StudySpec::sweep()),
        axes,
        max_parallel: parsed.max_parallel,
        on_failure: parsed.on_failure.unwrap_or(OnFailure::Continue).word(),
        refines,
        forecast: total.forecast(count, at_once),
        points: points.into_iter().map(|point| Value::Object(point.values.into_iter().collect())).collect(),
        jobs,
        total,
    })
}

/// The points of a sweep, and what is kept of them.
struct Swept<J> {
    points: Vec<SweepPoint>,
    axes: Vec<String>,
    jobs: Vec<J>,
    total: Total,
    /// Number of points that will be run in any case.
    count: usize,
}

fn swept<J, S: Sources>(
    sweep: &Sweep,
    base: &Json,
    (allowance, sources): (Allowance, &S),
    calibration: &Calibration,
    keep: impl Fn(&JobBody) -> J,
) -> Result<Swept<J>, BodyError<S::Error>> {
    if let Sweep::Refine { refine } = sweep {
        let refine::Levels { points, sure, total } =
            refine::check_levels(refine, base, (allowance, sources), calibration)?;
        return Ok(Swept { points, axes: refine.axes(), jobs: Vec::new(), total, count: sure });
    }
    let points = sweep.points().map_err(|error| vec![error])?;
    let axes = axes_of(&points)?;
    let (jobs, total) = bodies(base, &points, (allowance, sources), calibration, keep)?;
    Ok(Swept { count: jobs.len(), points, axes, jobs, total })
}

fn check_base(base: Option<&Json>, errors: &mut Vec<Violation>) {
    let Some(base) = base.filter(|base| base.is_object()) else {
        let detail = "a study has a job body that its points share";
        errors.push(Violation::new("/base", "required", detail, base.cloned().unwrap_or_default(), Value::Null));
        return;
    };
    let bytes = base.to_string().len();
    if bytes > LARGEST_BODY {
        let detail = format!("a job body in a study has at most {LARGEST_BODY} bytes");
        errors.push(Violation::new("/base", "range", detail, bytes, LARGEST_BODY));
    }
}

/// The pointers that vary, in the order in which they first occur.
fn axes_of(points: &[SweepPoint]) -> Result<Vec<String>, Vec<Violation>> {
    let mut axes: Vec<String> = Vec::new();
    let mut seen: HashSet<&str> = HashSet::new();
    for (pointer, _) in points.iter().flat_map(|point| &point.values) {
        if seen.insert(pointer) {
            axes.push(pointer.clone());
        }
    }
    if axes.len() > MOST_AXES {
        let detail = format!("a study has at most {MOST_AXES} axes");
        return Err(vec![Violation::new("/sweep", "range", detail, axes.len(), MOST_AXES)]);
    }
    Ok(axes)
}

/// What is kept of the body of each point, and what all of them will take.
fn bodies<J, S: Sources>(
    base: &Json,
    points: &[SweepPoint],
    (allowance, sources): (Allowance, &S),
    calibration: &Calibration,
    keep: impl Fn(&JobBody) -> J,
) -> Result<(Vec<J>, Total), BodyError<S::Error>> {
    let mut jobs = Vec::with_capacity(points.len());
    let mut total = Total { cpu_s: Some(0.0), ..Total::default() };
    let mut found = Found::default();
    for point in points {
        match point_body(base, point, allowance, sources) {
            Ok(mut body) => {
                body.forecast.time_by(calibration);
                total.add(&body);
                jobs.push(keep(&body));
            }
            Err(BodyError::Invalid(violations)) => found.add(point, violations),
            Err(error) => return Err(error),
        }
    }
    if found.by_pointer.is_empty() { Ok((jobs, total)) } else { Err(found.listed().into()) }
}

/// The body of one point: the base with the values of the point.
///
/// # Errors
/// Everything that is wrong with it, at the pointers of the body, or a failed look-up.
pub fn point_body<S: Sources>(
    base: &Value,
    point: &SweepPoint,
    allowance: Allowance,
    sources: &S,
) -> Result<JobBody, BodyError<S::Error>> {
    let mut body = base.clone();
    for (pointer, value) in &point.values {
        if !place_value(&mut body, pointer, value) {
            let detail = "the pointer leads through something that is no object";
            return Err(vec![Violation::new(pointer.clone(), "type", detail, value.clone(), Value::Null)].into());
        }
    }
    let body = body::parse(&body, allowance, sources)?;
    if body.wanted.is_some() {
        let detail = "an accuracy is asked for in a single job; a study that refines has `until`";
        return Err(vec![Violation::new("/accuracy", "conflict", detail, Value::Null, Value::Null)].into());
    }
    Ok(body)
}

/// Puts a value at a pointer; objects on the way are made where there are none. A choice given as a bare word becomes an
/// object of that type when something inside it is set.
fn place_value(body: &mut Value, pointer: &str, value: &Value) -> bool {
    let mut slot = body;
    let parts = pointer.split('/').skip(1).map(|part| part.replace("~1", "/").replace("~0", "~"));
    for part in parts {
        if let Value::String(word) = slot {
            *slot = json!({"type": word});
        }
        if slot.is_null() {
            *slot = json!({});
        }
        slot = match slot {
            Value::Object(map) => map.entry(part).or_insert(Value::Null),
            Value::Array(list) => match part.parse::<usize>().ok().and_then(|k| list.get_mut(k)) {
                Some(slot) => slot,
                None => return false,
            },
            _ => return false,
        };
    }
    *slot = value.clone();
    true
}

/// Violations of all points, each once.
#[derive(Default)]
struct Found {
    by_pointer: BTreeMap<(String, &'static str), Violation>,
    more: usize,
}

impl Found {
    fn add(&mut self, point: &SweepPoint, violations: Vec<Violation>) {
        for mut violation in violations {
            let of_axis = point.values.iter().zip(&point.places).find(|((pointer, _), _)| {
                violation
                    .pointer
                    .strip_prefix(pointer.as_str())
                    .is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
            });
            violation.pointer = match of_axis {
                Some(((pointer, _), place)) => format!("{place}{}", &violation.pointer[pointer.len()..]),
                None => format!("/base{}", violation.pointer),
            };
            self.add_one(violation);
        }
    }

    fn add_one(&mut self, violation: Violation) {
        let key = (violation.pointer.clone(), violation.code);
        if self.by_pointer.len() >= MOST_VIOLATIONS && !self.by_pointer.contains_key(&key) {
            self.more += 1;
        } else {
            self.by_pointer.entry(key).or_insert(violation);
        }
    }

    fn listed(self) -> Vec<Violation> {
        let mut all: Vec<Violation> = self.by_pointer.into_values().collect();
        if self.more > 0 {
            let detail = format!("{} more things are wrong", self.more);
            all.push(Violation::new("", "more", detail, Value::Null, Value::Null));
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::{MOST_POINTS, parse};
    use crate::spec::body::{Allowance, NoSources};
    use crate::spec::calibration::Calibration;
    use serde_json::{Value, json};

    const ALLOWANCE: Allowance = Allowance { threads: 2, memory_bytes: 4 << 30, local_files: false };

    fn points(spec: &Value) -> Vec<Value> {
        parse(spec, ALLOWANCE, 1, &NoSources, &Calibration::default(), |_| ()).ok().unwrap().points
    }

    fn errors(spec: &Value) -> Vec<(String, &'static str)> {
        let found = parse(spec, ALLOWANCE, 1, &NoSources, &Calibration::default(), |_| ()).err().unwrap().violations();
        found.into_iter().map(|v| (v.pointer, v.code)).collect()
    }

    #[test]
    fn grids_zips_and_lists() {
        let base = json!({"scene": {"kind": "redistance"}});
        let axes = json!({"/scene/spacing": [0.1, 0.05], "/scene/repeat": [1, 2, 3]});
        let grid = points(&json!({"base": base, "sweep": {"mode": "grid", "axes": axes}}));
        assert_eq!(grid.len(), 6);
        assert_eq!(grid[1], json!({"/scene/spacing": 0.1, "/scene/repeat": 2}));
        let axes = json!({"/scene/spacing": [0.1, 0.05], "/scene/repeat": [1, 2]});
        let zip = points(&json!({"base": base, "sweep": {"mode": "zip", "axes": axes}}));
        assert_eq!(
            zip,
            [json!({"/scene/spacing": 0.1, "/scene/repeat": 1}), json!({"/scene/spacing": 0.05, "/scene/repeat": 2})]
        );
        let list = json!([{"/scene/spacing": 0.1}, {"/scene/method": {"type": "pcp", "degree": 3}}]);
        assert_eq!(points(&json!({"base": base, "sweep": {"mode": "list", "points": list}})).len(), 2);
    }

    #[test]
    fn a_wrong_value_is_named_once_at_its_axis() {
        let axes = json!({"/scene/spacing": [0.1, -1], "/scene/repeat": (1..=50).collect::<Vec<_>>()});
        let spec =
            json!({"base": {"scene": {"kind": "redistance", "bandh": 1}}, "sweep": {"mode": "grid", "axes": axes}});
        let found = errors(&spec);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found.contains(&("/sweep/axes/~1scene~1spacing/1".to_owned(), "range")));
        assert!(found.contains(&("/base/scene/bandh".to_owned(), "unknown_field")));
    }

    #[test]
    fn what_is_no_sweep_is_refused() {
        let base = json!({"scene": {"kind": "redistance"}});
        for (spec, pointer) in [
            (json!({"base": base}), "/sweep"),
            (json!({"base": base, "sweep": {"mode": "gird"}}), "/sweep/mode"),
            (json!({"base": base, "sweep": {"mode": "grid", "axes": {}}}), "/sweep/axes"),
            (json!({"base": base, "sweep": {"mode": "list", "points": []}}), "/sweep/points"),
            (json!({"base": base, "sweep": {"mode": "zip", "axes": {"/a": [1], "/b": [1, 2]}}}), "/sweep/axes/~1b"),
            (json!({"base": base, "sweep": {"mode": "grid", "axes": {"spacing": [1]}}}), "/sweep/axes/spacing"),
            // Had ten thousand times, it would fill the memory.
            (
                json!({"base": base, "sweep": {"mode": "grid", "axes": {"/labels": [{"a": "x".repeat(20_000)}]}}}),
                "/sweep/axes/~1labels/0",
            ),
            (json!({"base": {"name": "x".repeat(70_000)}, "sweep": {"mode": "list", "points": [{}]}}), "/base"),
            (json!({"base": 3, "sweep": {"mode": "list", "points": [{}]}}), "/base"),
            (json!({"base": base, "sweep": {"mode": "list", "points": [{}]}, "max_parallel": 0}), "/max_parallel"),
            (json!({"base": base, "sweep": {"mode": "list", "points": [{}]}, "on_failure": "panic"}), "/on_failure"),
            (json!({"base": base, "sweep": {"mode": "list", "points": vec![json!({}); MOST_POINTS + 1]}}), "/sweep"),
        ] {
            assert!(errors(&spec).iter().any(|(at, _)| at == pointer), "{pointer}: {:?}", errors(&spec));
        }
    }
}
