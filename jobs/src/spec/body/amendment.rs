//! Changes of a job that waits: name, labels, priority and limits, as a JSON merge patch (RFC 7386).

use super::{Allowance, Labels, Name, Priority, ResolvedBody, limits};
use crate::spec::run_options::LimitsSpec;
use meniscus::spec::{Given, Group, Object, Violation, group};
use serde::Deserialize;
use serde_json::{Value, json};

meniscus::group! {
    /// What may be changed of a job that waits; `null` takes a value away.
    pub struct AmendmentSpec {
        /// name, for people
        name: Option<Name>;
        /// labels, for filters
        labels: Option<Labels>;
        /// limits of the run
        limits: Option<LimitsSpec>;
        /// rank in the queue: higher goes first
        priority: Option<Priority>;
    }
}

/// A changed body.
#[derive(Debug, Clone, PartialEq)]
pub struct Amended {
    /// The body as if it had been sent so.
    pub spec: Value,
    /// The body with every default.
    pub resolved: ResolvedBody,
}

/// Applies a patch to the body of a job; `needed_bytes` of memory its run was forecast to need.
///
/// # Errors
/// Everything that is wrong with the patch at once.
pub fn amend(
    spec: &Value,
    resolved: &Value,
    patch: &Value,
    allowance: Allowance,
    needed_bytes: u64,
) -> Result<Amended, Vec<Violation>> {
    let Value::Object(changes) = patch else {
        let allowed = json!(AmendmentSpec::names());
        return Err(vec![Violation::new("", "type", "a patch is an object", patch.clone(), allowed)]);
    };
    let mut errors = Vec::new();
    group::check_names(changes, &AmendmentSpec::names(), "", &mut errors);
    let mut changed = spec.clone();
    merge(&mut changed, patch);
    let all = changed.as_object().cloned().unwrap_or_default();
    let amendable: Object =
        all.into_iter().filter(|(name, _)| AmendmentSpec::names().contains(&name.as_str())).collect();
    let parsed = AmendmentSpec::parse_fields(&amendable, "", &mut errors);
    let limits = limits(Given::new(&amendable), allowance, &mut errors);
    if let Some(limits) = limits.as_ref().filter(|limits| limits.memory_bytes < needed_bytes) {
        let detail = format!("the run is forecast to need {needed_bytes} bytes");
        errors.push(Violation::new("/limits/memory_bytes", "memory", detail, limits.memory_bytes, Value::Null));
    }
    let body = ResolvedBody::deserialize(resolved).map_err(|error| {
        vec![Violation::new(
            "",
            "internal",
            format!("the stored body cannot be read: {error}"),
            Value::Null,
            Value::Null,
        )]
    })?;
    match (parsed, limits) {
        (Some(AmendmentSpec { name, labels, priority, .. }), Some(limits)) if errors.is_empty() => {
            let resolved = ResolvedBody {
                name: name.map(|name| name.0),
                labels: labels.unwrap_or_default().0,
                priority: priority.unwrap_or_default().0,
                options: crate::spec::run_options::RunOptions { limits, ..body.options },
                ..body
            };
            Ok(Amended { spec: changed, resolved })
        }
        _ => Err(errors),
    }
}

/// Merges a patch into a value: objects field by field, `null` removes, anything else replaces.
fn merge(target: &mut Value, patch: &Value) {
    let Value::Object(changes) = patch else {
        target.clone_from(patch);
        return;
    };
    if !target.is_object() {
        *target = json!({});
    }
    let Value::Object(fields) = target else { return };
    for (name, change) in changes {
        if change.is_null() {
            fields.shift_remove(name);
        } else {
            merge(fields.entry(name.clone()).or_insert(Value::Null), change);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::amend;
    use crate::spec::body::{Allowance, NoSources, parse};
    use serde_json::{Value, json};

    const ALLOWANCE: Allowance = Allowance { threads: 2, memory_bytes: 1 << 32, local_files: false };

    fn amended(patch: &Value) -> Result<(Value, Value), Vec<(String, String)>> {
        let spec = json!({"name": "a", "labels": {"x": "1", "y": "2"}, "limits": {"wall_s": 5, "threads": 1},
            "scene": {"kind": "redistance"}});
        let body = parse(&spec, ALLOWANCE, &NoSources).ok().unwrap();
        let done = amend(&spec, &body.resolved.to_json(), patch, ALLOWANCE, 1 << 25);
        done.map(|done| (done.spec, done.resolved.to_json()))
            .map_err(|errors| errors.into_iter().map(|error| (error.pointer, error.code.to_owned())).collect())
    }

    #[test]
    fn a_patch_changes_what_it_names_and_nothing_else() {
        let patch = json!({"name": null, "labels": {"x": null, "z": "3"}, "priority": 4, "limits": {"wall_s": 9}});
        let (spec, resolved) = amended(&patch).unwrap();
        assert_eq!(spec["labels"], json!({"y": "2", "z": "3"}));
        assert_eq!(resolved["name"], Value::Null);
        assert_eq!((&resolved["priority"], &resolved["limits"]["wall_s"]), (&json!(4), &json!(9.0)));
        assert_eq!((&resolved["limits"]["threads"], &resolved["scene"]["kind"]), (&json!(1), &json!("redistance")));
    }

    #[test]
    fn all_that_is_wrong_comes_at_once() {
        let patch =
            json!({"nam": "x", "scene": {}, "priority": 1000, "limits": {"threads": 99, "memory_bytes": 2_000_000}});
        let places: Vec<String> = amended(&patch).unwrap_err().into_iter().map(|(place, _)| place).collect();
        for place in ["/nam", "/scene", "/priority", "/limits/threads", "/limits/memory_bytes"] {
            assert!(places.iter().any(|found| found == place), "{place}: {places:?}");
        }
    }
}
