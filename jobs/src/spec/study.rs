//! Studies: a base body and a sweep over it.
//!
//! `{"base": {job body}, "sweep": {"mode": "grid" | "zip" | "list", "axes": {POINTER: [values]} | "points": [{POINTER:
//! value}]}, "max_parallel", "on_failure": "continue" | "stop", "name", "labels"}`. Pointers start at the job's body.

use crate::service::store::{NewJob, NewStudy};
use crate::spec::body::{self, Allowance, JobBody, Sources};
use crate::spec::calibration::Calibration;
use meniscus::scene::{Violation, check};
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, HashSet};

/// Points of a study at most.
pub const MOST_POINTS: usize = 10_000;
/// Pointers that vary at most.
const MOST_AXES: usize = 64;
/// Bytes of a body, and of one value of an axis, at most: there are ten thousand of them.
const LARGEST_BODY: usize = 64 << 10;
const LARGEST_VALUE: usize = 16 << 10;
/// Violations that are listed at most; the rest is counted.
const MOST_VIOLATIONS: usize = 100;
const FIELDS: [&str; 6] = ["base", "sweep", "max_parallel", "on_failure", "name", "labels"];
const MODES: [&str; 3] = ["grid", "zip", "list"];

/// A point: values by pointer.
type Point = Vec<(String, Value)>;

/// What all points of a study will take together.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Total {
    /// CPU seconds, where all points could be judged.
    pub cpu_s: Option<f64>,
    /// Most memory of one.
    pub memory_bytes: u64,
    /// Bytes of all files.
    pub disk_bytes: u64,
}

impl Total {
    /// As JSON; the clock goes by how many run at once.
    #[must_use]
    pub fn to_json(self, points: usize, at_once: usize) -> Value {
        let at_once = at_once.clamp(1, points.max(1)) as f64;
        json!({
            "points": points, "cpu_s": self.cpu_s, "wall_s": self.cpu_s.map(|cpu_s| cpu_s / at_once),
            "memory_bytes": self.memory_bytes, "disk_bytes": self.disk_bytes,
        })
    }
}

/// A study as understood.
pub struct Study {
    /// What is to be stored.
    pub new: NewStudy,
    /// The values of every point.
    pub points: Vec<Value>,
    /// What all points will take.
    pub total: Total,
}

/// From a client's JSON to a study; `slots` jobs run at once.
///
/// # Errors
/// All violations at once (the first hundred of them), nothing is made then. A violation at an axis' pointer is reported
/// once, at the axis' value.
pub fn parse(
    spec: &Value,
    allowance: Allowance,
    slots: usize,
    sources: &dyn Sources,
    calibration: &Calibration,
) -> Result<Study, Vec<Violation>> {
    let Value::Object(given) = spec else {
        return Err(vec![Violation::new("", "type", "a study is an object", spec, json!(FIELDS))]);
    };
    let mut errors = Vec::new();
    for (name, value) in given.iter().filter(|(name, _)| !FIELDS.contains(&name.as_str())) {
        let at = format!("/{}", check::escaped(name));
        let mut violation = Violation::new(at, "unknown_field", "there is no such field", value, json!(FIELDS));
        violation.did_you_mean = check::closest(name, &FIELDS);
        errors.push(violation);
    }
    let name = body::text(given, "name", &mut errors);
    let labels = body::labels(given, &mut errors);
    let max_parallel = max_parallel(given, &mut errors);
    let on_failure = match given.get("on_failure") {
        None | Some(Value::Null) => "continue",
        Some(Value::String(word)) if word == "continue" => "continue",
        Some(Value::String(word)) if word == "stop" => "stop",
        Some(other) => {
            let detail = "what to do when a point fails";
            errors.push(Violation::new("/on_failure", "unknown", detail, other, json!(["continue", "stop"])));
            "continue"
        }
    };
    let base = given.get("base").cloned().unwrap_or(Value::Null);
    if !base.is_object() {
        errors.push(Violation::new(
            "/base",
            "required",
            "a study has a job body that its points share",
            &base,
            Value::Null,
        ));
    }
    let base_bytes = base.to_string().len();
    if base_bytes > LARGEST_BODY {
        let detail = format!("a job body in a study has at most {LARGEST_BODY} bytes");
        errors.push(Violation::new("/base", "range", detail, &json!(base_bytes), json!(LARGEST_BODY)));
    }
    let points = if errors.is_empty() { sweep(given.get("sweep"), &mut errors) } else { Vec::new() };
    if !errors.is_empty() {
        return Err(errors);
    }
    let mut axes: Vec<String> = Vec::new();
    let mut seen: HashSet<&str> = HashSet::new();
    for (pointer, _) in points.iter().flat_map(|point| &point.values) {
        if seen.insert(pointer) {
            axes.push(pointer.clone());
        }
    }
    if axes.len() > MOST_AXES {
        let detail = format!("a study has at most {MOST_AXES} axes");
        return Err(vec![Violation::new("/sweep", "range", detail, &json!(axes.len()), json!(MOST_AXES))]);
    }
    let mut jobs = Vec::with_capacity(points.len());
    let mut total = Total { cpu_s: Some(0.0), ..Total::default() };
    let mut found = Found::default();
    for point in &points {
        match understand(&base, point, allowance, sources) {
            Ok(mut body) => {
                body.forecast.time_by(calibration);
                let time = body.forecast.time.as_ref().map(|time| time.cpu_s);
                total.cpu_s = total.cpu_s.zip(time).map(|(a, b)| a + b);
                total.memory_bytes = total.memory_bytes.max(body.forecast.memory_bytes);
                total.disk_bytes = total.disk_bytes.saturating_add(body.forecast.disk_bytes);
                jobs.push(NewJob::of(&body));
            }
            Err(violations) => found.add(point, violations),
        }
    }
    if !found.by_pointer.is_empty() {
        return Err(found.listed());
    }
    let at_once = max_parallel.map_or(slots, |most| slots.min(most as usize));
    let estimate = total.to_json(jobs.len(), at_once);
    let values = points.into_iter().map(|point| Value::Object(point.values.into_iter().collect())).collect();
    let sweep = given.get("sweep").cloned().unwrap_or(Value::Null);
    let new = NewStudy { name, labels, base, sweep, axes, max_parallel, on_failure, estimate, jobs };
    Ok(Study { new, points: values, total })
}

fn max_parallel(given: &Map<String, Value>, errors: &mut Vec<Violation>) -> Option<u64> {
    match given.get("max_parallel") {
        None | Some(Value::Null) => None,
        Some(value) => {
            let number = value.as_u64().filter(|most| (1..=1_000_000).contains(most));
            if number.is_none() {
                let detail = "so many jobs of the study may run at once";
                errors.push(Violation::new("/max_parallel", "range", detail, value, json!("a whole number ≥ 1")));
            }
            number
        }
    }
}

/// A point, and where each of its values stands in the sweep.
struct SweepPoint {
    values: Point,
    places: Vec<String>,
}

/// The points of a sweep in order: of a grid the last axis runs fastest.
fn sweep(sweep: Option<&Value>, errors: &mut Vec<Violation>) -> Vec<SweepPoint> {
    let empty = Value::Null;
    let sweep = sweep.unwrap_or(&empty);
    let mode = sweep["mode"].as_str().filter(|mode| MODES.contains(mode));
    let Some(mode) = mode else {
        let detail = "a sweep names its mode";
        errors.push(Violation::new("/sweep/mode", "unknown", detail, &sweep["mode"], json!(MODES)));
        return Vec::new();
    };
    let wanted = if mode == "list" { "points" } else { "axes" };
    for (name, value) in sweep.as_object().into_iter().flatten() {
        if name != "mode" && name != wanted {
            let at = format!("/sweep/{}", check::escaped(name));
            let detail = format!("a sweep of mode {mode} has a mode and {wanted}");
            errors.push(Violation::new(at, "unknown_field", detail, value, json!(["mode", wanted])));
        }
    }
    let points = if mode == "list" { list(&sweep["points"], errors) } else { axes(mode, &sweep["axes"], errors) };
    if errors.is_empty() && points.is_empty() {
        let detail = "a sweep has at least one point";
        errors.push(Violation::new(format!("/sweep/{wanted}"), "required", detail, &sweep[wanted], Value::Null));
    }
    points
}

fn check_pointer(pointer: &str, at: &str, errors: &mut Vec<Violation>) {
    if !pointer.starts_with('/') || pointer.len() > 200 {
        let detail = "an axis is a JSON pointer into the job's body";
        errors.push(Violation::new(at, "type", detail, &json!(pointer), json!("/scene/spacing, for instance")));
    }
}

/// Refuses a value that is too large to be had ten thousand times.
fn check_value(value: &Value, at: &str, errors: &mut Vec<Violation>) {
    // Numbers, the usual values, are not written out for that.
    if !value.is_number() && value.to_string().len() > LARGEST_VALUE {
        let detail = format!("a value of an axis has at most {LARGEST_VALUE} bytes");
        errors.push(Violation::new(at, "range", detail, &Value::Null, json!(LARGEST_VALUE)));
    }
}

fn too_many(count: usize, errors: &mut Vec<Violation>) -> bool {
    if count > MOST_POINTS {
        let detail = format!("a study has at most {MOST_POINTS} points");
        errors.push(Violation::new("/sweep", "range", detail, &json!(count), json!(MOST_POINTS)));
    }
    count > MOST_POINTS
}

fn list(points: &Value, errors: &mut Vec<Violation>) -> Vec<SweepPoint> {
    let Some(points) = points.as_array() else {
        let detail = "a list has points: objects from JSON pointers to values";
        errors.push(Violation::new("/sweep/points", "type", detail, points, json!([{"/scene/spacing": 0.01}])));
        return Vec::new();
    };
    if too_many(points.len(), errors) {
        return Vec::new();
    }
    let mut found = Vec::with_capacity(points.len());
    for (k, point) in points.iter().enumerate() {
        let at = format!("/sweep/points/{k}");
        let Some(map) = point.as_object() else {
            let detail = "a point is an object from JSON pointers to values";
            errors.push(Violation::new(at, "type", detail, point, Value::Null));
            continue;
        };
        let mut one = SweepPoint { values: Vec::new(), places: Vec::new() };
        for (pointer, value) in map {
            let place = format!("{at}/{}", check::escaped(pointer));
            check_pointer(pointer, &place, errors);
            check_value(value, &place, errors);
            one.values.push((pointer.clone(), value.clone()));
            one.places.push(place);
        }
        found.push(one);
    }
    found
}

fn axes(mode: &str, axes: &Value, errors: &mut Vec<Violation>) -> Vec<SweepPoint> {
    let Some(axes) = axes.as_object().filter(|axes| !axes.is_empty()) else {
        let detail = "axes are an object from JSON pointers to lists of values";
        errors.push(Violation::new("/sweep/axes", "type", detail, axes, json!({"/scene/spacing": [0.02, 0.01]})));
        return Vec::new();
    };
    let mut lists: Vec<(&String, &Vec<Value>)> = Vec::new();
    for (pointer, values) in axes {
        let at = format!("/sweep/axes/{}", check::escaped(pointer));
        check_pointer(pointer, &at, errors);
        match values.as_array().filter(|values| !values.is_empty()) {
            Some(values) => {
                for (k, value) in values.iter().enumerate() {
                    check_value(value, &format!("{at}/{k}"), errors);
                }
                lists.push((pointer, values));
            }
            None => {
                errors.push(Violation::new(at, "type", "an axis has a list of values", values, json!([0.02, 0.01])));
            }
        }
    }
    if !errors.is_empty() {
        return Vec::new();
    }
    let lengths = lists.iter().map(|(_, values)| values.len());
    let count = if mode == "grid" {
        lengths.fold(1_usize, usize::saturating_mul)
    } else {
        let count = lengths.clone().next().unwrap_or(0);
        if let Some((pointer, values)) = lists.iter().find(|(_, values)| values.len() != count) {
            let detail = format!("axes of a zip are of one length; the first has {count} values");
            let at = format!("/sweep/axes/{}", check::escaped(pointer));
            errors.push(Violation::new(at, "range", detail, &json!(values.len()), json!(count)));
            return Vec::new();
        }
        count
    };
    if too_many(count, errors) {
        return Vec::new();
    }
    let point = |index: usize| {
        let mut rest = index;
        let mut one = SweepPoint { values: Vec::new(), places: Vec::new() };
        for (pointer, values) in lists.iter().rev() {
            let k = if mode == "grid" { rest % values.len() } else { index };
            rest /= values.len();
            one.values.push(((*pointer).clone(), values[k].clone()));
            one.places.push(format!("/sweep/axes/{}/{k}", check::escaped(pointer)));
        }
        one.values.reverse();
        one.places.reverse();
        one
    };
    (0..count).map(point).collect()
}

/// The body of one point.
fn understand(
    base: &Value,
    point: &SweepPoint,
    allowance: Allowance,
    sources: &dyn Sources,
) -> Result<JobBody, Vec<Violation>> {
    let mut body = base.clone();
    for (pointer, value) in &point.values {
        if !place_value(&mut body, pointer, value) {
            let detail = "the pointer leads through something that is no object";
            return Err(vec![Violation::new(pointer.clone(), "type", detail, value, Value::Null)]);
        }
    }
    body::parse(&body, allowance, sources)
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
            let key = (violation.pointer.clone(), violation.code);
            if self.by_pointer.len() >= MOST_VIOLATIONS && !self.by_pointer.contains_key(&key) {
                self.more += 1;
            } else {
                self.by_pointer.entry(key).or_insert(violation);
            }
        }
    }

    fn listed(self) -> Vec<Violation> {
        let mut all: Vec<Violation> = self.by_pointer.into_values().collect();
        if self.more > 0 {
            let detail = format!("{} more things are wrong", self.more);
            all.push(Violation::new("", "more", detail, &Value::Null, Value::Null));
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
        parse(spec, ALLOWANCE, 1, &NoSources, &Calibration::default()).ok().unwrap().points
    }

    fn errors(spec: &Value) -> Vec<(String, &'static str)> {
        let found = parse(spec, ALLOWANCE, 1, &NoSources, &Calibration::default()).err().unwrap();
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
            (json!({"base": base}), "/sweep/mode"),
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
