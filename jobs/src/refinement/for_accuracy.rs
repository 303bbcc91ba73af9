//! The sweep that finds the spacing for an accuracy: where it begins, and what it compares.

use super::short_runs::{Known, curve_of};
use crate::spec::accuracy::Wanted;
use crate::spec::body::{Allowance, BodyError, JobBody, Sources};
use crate::spec::study::{SweepPoint, point_body};
use crate::spec::work_precision::error_scale;
use meniscus::spec::Json;
use serde_json::{Value, json};

/// Spacings of the first level by the default one, the coarsest first.
const FIRST_SPACINGS: [f64; 6] = [8.0, 5.6, 4.0, 2.8, 2.0, 1.4];

/// The body that the levels share: what was sent, without what belongs to the one job.
#[must_use]
pub fn base_of(spec: &Value) -> Value {
    let mut base = spec.clone();
    if let Some(body) = base.as_object_mut() {
        for name in ["accuracy", "after"] {
            body.shift_remove(name);
        }
    }
    base
}

/// The sweep for a body that asks for an accuracy, over the base of [`base_of`].
///
/// # Errors
/// A failed look-up.
pub fn sweep<S: Sources>(
    body: &JobBody,
    wanted: &Wanted,
    allowance: Allowance,
    sources: &S,
    known: Known<'_, S::Error>,
) -> Result<Value, BodyError<S::Error>> {
    let search = Search { body, wanted, base: base_of(&body.spec), allowance, sources };
    let (from, choices) = match search.told(known)? {
        Some(told) => told,
        None => {
            let from = search.first_value()?;
            (from, search.open_choices(from)?)
        }
    };
    Ok(wanted.sweep(from, &choices))
}

/// Spacings of the first level by the one that short runs tell, the coarsest first.
const PILOTS: [f64; 4] = [2.0, 1.7, 1.4, 1.0];

/// A search among bodies.
struct Search<'a, S> {
    body: &'a JobBody,
    wanted: &'a Wanted,
    base: Json,
    allowance: Allowance,
    sources: &'a S,
}

/// Pointer of a value of the scene, and the value.
type Choice = (&'static str, Json);

/// What short runs tell of a choice: a spacing that would do, and its CPU seconds.
struct Begin {
    spacing: f64,
    cpu_s: f64,
    choice: Option<Choice>,
}

/// Pointer of a value of the scene that the body leaves open, and the values that are compared.
type OpenChoice = (&'static str, Vec<Json>);

/// The value of the axis at the first level, and the choices that are compared.
type Begun = (f64, Vec<OpenChoice>);

impl<S: Sources> Search<'_, S> {
    /// The body with some values of the scene, if that is valid.
    fn body_with(&self, values: &[(&str, Json)]) -> Result<Option<JobBody>, BodyError<S::Error>> {
        let values: Vec<(String, Json)> =
            values.iter().map(|(pointer, value)| (format!("/scene{pointer}"), value.clone())).collect();
        let places = vec!["/accuracy".to_owned(); values.len()];
        match point_body(&self.base, &SweepPoint { values, places }, self.allowance, self.sources) {
            Ok(body) => Ok(Some(body)),
            Err(BodyError::Invalid(_)) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Whether nothing is doubtful of a level before it runs that is not so of the body itself.
    fn is_no_more_doubtful(&self, level: &JobBody) -> bool {
        let known = self.body.scene.warnings();
        level.scene.warnings().iter().all(|found| known.iter().any(|known| known.code == found.code))
    }

    /// The value of the axis for a spacing.
    fn axis_value(&self, spacing: f64) -> Option<f64> {
        Some(self.axis_value_by_default(spacing / self.body.scene.spacing()?))
    }

    /// The value of the axis for a spacing by that of the body as it is.
    fn axis_value_by_default(&self, coarser: f64) -> f64 {
        let value = Value::pointer(&self.body.resolved.scene, self.wanted.axis).and_then(Value::as_f64);
        if self.wanted.axis == "/count" {
            // Where the body has none, the count is that of the default spacing.
            let count = value.unwrap_or(self.body.forecast.estimate.particles as f64);
            (count / (coarser * coarser)).round()
        } else {
            value.or(self.body.scene.spacing()).unwrap_or(1.0) * coarser
        }
    }

    /// Where short runs tell the search to begin: a level about twice as coarse as would do, with the choice that is cheapest by them.
    /// The others stand behind it, since that level may say something else.
    fn told(&self, known: Known<'_, S::Error>) -> Result<Option<Begun>, BodyError<S::Error>> {
        let begins = self.begins(known)?;
        let Some(Begin { spacing, choice, .. }) = begins.first() else { return Ok(None) };
        for coarser in PILOTS {
            let Some(value) = self.axis_value(spacing * coarser) else { return Ok(None) };
            let given: Vec<Choice> = choice.iter().cloned().chain([(self.wanted.axis, json!(value))]).collect();
            let level = self.body_with(&given)?;
            if level.is_some_and(|level| self.is_no_more_doubtful(&level)) {
                let mut open: Vec<OpenChoice> = Vec::new();
                for (pointer, value) in begins.into_iter().filter_map(|begin| begin.choice) {
                    match open.iter_mut().find(|(known, _)| *known == pointer) {
                        Some((_, values)) => values.push(value),
                        None if self.is_open(pointer) => open.push((pointer, vec![value])),
                        None => {}
                    }
                }
                return Ok(Some((value, open)));
            }
        }
        Ok(None)
    }

    /// What short runs of other scenes tell of the choices, the one first that reaches the tolerance with the least CPU time.
    fn begins(&self, known: Known<'_, S::Error>) -> Result<Vec<Begin>, BodyError<S::Error>> {
        let wish = &self.wanted.spec;
        let error = wish.quantity.error.as_ref().filter(|_| !wish.relative && wish.quantity.time.is_none());
        let (Some(error), Some(size)) = (error, self.body.scene.size()) else { return Ok(Vec::new()) };
        let tolerance = wish.tolerance / error_scale(self.body.scene.as_ref(), &error.quantity, size);
        let mut begins: Vec<Begin> = Vec::new();
        for choice in self.choices() {
            let given: Vec<Choice> = choice.iter().cloned().collect();
            let Some(body) = self.body_with(&given)? else { continue };
            let curve = curve_of(&body, (&error.quantity, &error.norm), known).map_err(BodyError::Lookup)?;
            let place = curve.as_ref().and_then(|curve| Some((curve, curve.place(tolerance)?)));
            let Some((curve, place)) = place else { continue };
            let Some(cpu_s) = curve.cost(place.spacing) else { continue };
            begins.push(Begin { spacing: place.spacing * size, cpu_s, choice });
        }
        begins.sort_by(|a, b| a.cpu_s.total_cmp(&b.cpu_s));
        Ok(begins)
    }

    /// Whether the body leaves a value of the scene open.
    fn is_open(&self, pointer: &str) -> bool {
        Value::pointer(&self.base, &format!("/scene{pointer}")).is_none()
    }

    /// The values of a choice that the body leaves open, or the one that it gives; nothing where the scene has no choice.
    fn choices(&self) -> Vec<Option<Choice>> {
        let mut found: Vec<Option<Choice>> = Vec::new();
        for (pointer, values) in self.body.scene.choices() {
            let given = Value::pointer(&self.base, &format!("/scene{pointer}"));
            let values = values.into_iter().filter(|value| given.is_none_or(|given| given == value));
            found.extend(values.map(|value| Some((pointer, value))));
        }
        if found.is_empty() { vec![None] } else { found }
    }

    /// The value of the axis at the first level: the coarsest that is valid and of which nothing is doubtful before it runs.
    fn first_value(&self) -> Result<f64, BodyError<S::Error>> {
        for coarser in FIRST_SPACINGS {
            let value = self.axis_value_by_default(coarser);
            let level = self.body_with(&[(self.wanted.axis, json!(value))])?;
            if level.is_some_and(|level| self.is_no_more_doubtful(&level)) {
                return Ok(value);
            }
        }
        Ok(self.axis_value_by_default(1.0))
    }

    /// Values of the scene that the body leaves open, with those that are compared: the ones that go with the rest of the scene.
    fn open_choices(&self, from: f64) -> Result<Vec<OpenChoice>, BodyError<S::Error>> {
        let mut open = Vec::new();
        for (pointer, values) in self.body.scene.choices() {
            if !self.is_open(pointer) {
                continue;
            }
            let mut possible = Vec::new();
            for value in values {
                if self.body_with(&[(self.wanted.axis, json!(from)), (pointer, value.clone())])?.is_some() {
                    possible.push(value);
                }
            }
            if possible.len() > 1 {
                open.push((pointer, possible));
            }
        }
        Ok(open)
    }
}

#[cfg(test)]
mod tests {
    use super::{base_of, sweep};
    use crate::convergence::Level;
    use crate::spec::body::{self, Allowance, NoSources};
    use serde_json::{Value, json};
    use std::convert::Infallible;

    /// The sweep for a redistancing to 1e-6; `order` is that of a choice of its own, by its name, and `size` half the shape.
    fn found(scene: &Value, order: impl Fn(&str) -> Option<f64>) -> Value {
        let accuracy = json!({"quantity": {"error": {"quantity": "phi", "norm": "rms"}}, "tolerance": 1e-6});
        let allowance = Allowance { threads: 1, memory_bytes: 4 << 30, local_files: false };
        let body = body::parse(&json!({"scene": scene, "accuracy": accuracy}), allowance, &NoSources).unwrap();
        let known = |name: &str, _: &str, _: &str| -> Result<Vec<Level>, Infallible> {
            let level = |order: f64, h: f64| Level { spacing: h, value: h.powf(order), cpu_s: h.powi(-2) };
            Ok(order(name).map_or(Vec::new(), |order| [0.4, 0.2, 0.1].map(|h| level(order, h)).to_vec()))
        };
        let wanted = body.wanted.as_ref().unwrap();
        sweep(&body, wanted, allowance, &NoSources, &known)
            .unwrap_or_else(|_| panic!("no sweep for {:?}", base_of(&body.spec)))
    }

    #[test]
    fn short_runs_tell_the_set_up_and_where_to_begin() {
        let scene = json!({"kind": "redistance", "shape": {"type": "circle", "radius": 0.5}});
        let by_degree =
            |name: &str| (3..7).find(|n| name.contains(&format!("\"degree\":{n}"))).map(|n| f64::from(n) + 1.0);
        let told = found(&scene, by_degree);
        let methods = told["alternatives"]["/scene/method"].as_array().unwrap();
        assert_eq!(
            (&methods[0], methods.len()),
            (&json!({"type": "pcp", "degree": 6}), 4),
            "the cheapest first: {told}"
        );
        // h⁷ = 1e-6/0.5 by the radius of 0.5, and twice as coarse.
        let spacing = 0.5 * (2e-6_f64).powf(1.0 / 7.0);
        let from = told["from"].as_f64().unwrap();
        assert!(
            [2.0, 1.7, 1.4, 1.0].iter().any(|coarser| (from / spacing / coarser - 1.0).abs() < 1e-9),
            "{from} {spacing}"
        );
        // A degree that is given is kept.
        let given = json!({"kind": "redistance", "shape": {"type": "circle", "radius": 0.5}, "method": {"type": "pcp", "degree": 4}});
        let told = found(&given, by_degree);
        assert!(told.get("alternatives").is_none() && told["from"] != from, "{told}");
        // Where nothing is known, all are compared.
        let unknown = found(&scene, |_| None);
        assert_eq!(unknown["alternatives"]["/scene/method"].as_array().map(Vec::len), Some(4));
    }
}
