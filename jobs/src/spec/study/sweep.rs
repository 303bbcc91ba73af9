//! Sweeps: the points of a study, as axes or as a list.

use super::axes::{AXES, Axes, SweepPoint, check_pointer, check_value};
use super::refine::RefineSpec;
use meniscus::spec::{Json, Object, Parameter, Violation, escape};
use serde_json::{Map, Value, json};

/// Points of a study at most.
pub const MOST_POINTS: usize = 10_000;

meniscus::choice! {
    /// How the points of a study come about.
    pub enum Sweep by "mode" {
        /// every combination of the values of the axes; the last axis runs fastest
        Grid = "grid" {
            /// lists of values by JSON pointers into the job's body
            axes: Axes;
        }
        /// the first values of all axes, the second ones, and so on; axes are of one length
        Zip = "zip" {
            /// lists of values by JSON pointers into the job's body
            axes: Axes;
        }
        /// the points one by one
        List = "list" {
            /// objects from JSON pointers into the job's body to values
            points: Points;
        }
        /// levels of refinement, one after another, until a quantity is known to a tolerance
        Refine = "refine" {
            /// the levels
            refine: RefineSpec => flatten;
        }
    }
}

/// Points one by one.
#[derive(Debug, Clone, PartialEq)]
pub struct Points(Vec<Object>);

impl Sweep {
    /// The points in order; those of a refinement follow from its base.
    ///
    /// # Errors
    /// Where there are too many, and where the axes of a zip differ in length.
    pub fn points(&self) -> Result<Vec<SweepPoint>, Violation> {
        match self {
            Self::Grid { axes } => {
                let count = axes.0.iter().map(|(_, values)| values.len()).fold(1_usize, usize::saturating_mul);
                check_count(count)?;
                Ok(axes.grid(AXES, count))
            }
            Self::Zip { axes } => {
                let count = axes.common_length()?;
                check_count(count)?;
                Ok((0..count).map(|index| axes.point(AXES, |_| index)).collect())
            }
            Self::List { points } => {
                check_count(points.0.len())?;
                Ok(points.0.iter().enumerate().map(|(k, values)| listed_point(k, values)).collect())
            }
            Self::Refine { .. } => Ok(Vec::new()),
        }
    }
}

fn check_count(count: usize) -> Result<(), Violation> {
    let detail = format!("a study has at most {MOST_POINTS} points");
    if count > MOST_POINTS { Err(Violation::new("/sweep", "range", detail, count, MOST_POINTS)) } else { Ok(()) }
}

fn listed_point(k: usize, values: &Object) -> SweepPoint {
    let place = |pointer: &String| format!("/sweep/points/{k}/{}", escape(pointer));
    SweepPoint {
        values: values.iter().map(|(pointer, value)| (pointer.clone(), value.clone())).collect(),
        places: values.keys().map(place).collect(),
    }
}

impl Parameter for Points {
    type Domain = ();

    fn any() {}

    fn parse(given: &Json, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let Some(points) = given.as_array() else {
            let detail = "a list has points: objects from JSON pointers to values";
            errors.push(Violation::new(place, "type", detail, given.clone(), Self::allowed(())));
            return None;
        };
        if points.is_empty() {
            let detail = "a sweep has at least one point";
            errors.push(Violation::new(place, "required", detail, given.clone(), Self::allowed(())));
            return None;
        }
        let before = errors.len();
        let mut objects = Vec::with_capacity(points.len());
        // More than are allowed are counted later, not looked at.
        for (k, point) in points.iter().enumerate().take(MOST_POINTS) {
            let at = format!("{place}/{k}");
            let Some(map) = point.as_object() else {
                let detail = "a point is an object from JSON pointers to values";
                errors.push(Violation::new(at, "type", detail, point.clone(), Value::Null));
                continue;
            };
            for (pointer, value) in map {
                let at = format!("{at}/{}", escape(pointer));
                check_pointer(pointer, &at, errors);
                check_value(value, &at, errors);
            }
            objects.push(map.clone());
        }
        if points.len() > MOST_POINTS {
            errors.extend(check_count(points.len()).err());
        }
        (errors.len() == before).then_some(Self(objects))
    }

    fn allowed((): ()) -> Json {
        json!([{"/scene/spacing": 0.01}])
    }

    fn schema((): ()) -> Object {
        let point = json!({"type": "object"});
        Map::from_iter([
            ("type".to_owned(), json!("array")),
            ("items".to_owned(), point),
            ("minItems".to_owned(), json!(1)),
            ("maxItems".to_owned(), json!(MOST_POINTS)),
        ])
    }

    fn to_json(&self) -> Json {
        self.0.iter().cloned().map(Json::Object).collect()
    }
}
