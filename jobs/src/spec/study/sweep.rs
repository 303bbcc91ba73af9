//! Sweeps: the points of a study, as axes or as a list.

use meniscus::spec::{Json, Object, Parameter, Violation, escape};
use serde_json::{Map, Value, json};

/// Points of a study at most.
pub const MOST_POINTS: usize = 10_000;
/// Bytes of a value of an axis at most: there may be ten thousand copies of it.
const LARGEST_VALUE: usize = 16 << 10;
/// Bytes of a pointer at most.
const LONGEST_POINTER: usize = 200;

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
    }
}

/// A point: its values by pointer, and where each of them stands in the sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepPoint {
    /// Values by pointer.
    pub values: Vec<(String, Json)>,
    /// Pointers to the values in the study's body.
    pub places: Vec<String>,
}

/// Lists of values by pointer.
#[derive(Debug, Clone, PartialEq)]
pub struct Axes(Vec<(String, Vec<Json>)>);

/// Points one by one.
#[derive(Debug, Clone, PartialEq)]
pub struct Points(Vec<Object>);

impl Sweep {
    /// The points in order.
    ///
    /// # Errors
    /// Where there are too many, and where the axes of a zip differ in length.
    pub fn points(&self) -> Result<Vec<SweepPoint>, Violation> {
        match self {
            Self::Grid { axes } => {
                let count = axes.0.iter().map(|(_, values)| values.len()).fold(1_usize, usize::saturating_mul);
                check_count(count)?;
                Ok((0..count).map(|index| axes.grid_point(index)).collect())
            }
            Self::Zip { axes } => {
                let count = axes.common_length()?;
                check_count(count)?;
                Ok((0..count).map(|index| axes.point(|_| index)).collect())
            }
            Self::List { points } => {
                check_count(points.0.len())?;
                Ok(points.0.iter().enumerate().map(|(k, values)| listed_point(k, values)).collect())
            }
        }
    }
}

fn check_count(count: usize) -> Result<(), Violation> {
    let detail = format!("a study has at most {MOST_POINTS} points");
    if count > MOST_POINTS { Err(Violation::new("/sweep", "range", detail, count, MOST_POINTS)) } else { Ok(()) }
}

fn axis_place(pointer: &str) -> String {
    format!("/sweep/axes/{}", escape(pointer))
}

impl Axes {
    /// The point with the `index_of(axis)`-th value of each axis.
    fn point(&self, index_of: impl Fn(usize) -> usize) -> SweepPoint {
        let indices = (0..self.0.len()).map(index_of);
        let (values, places) = self
            .0
            .iter()
            .zip(indices)
            .map(|((pointer, values), k)| {
                ((pointer.clone(), values[k].clone()), format!("{}/{k}", axis_place(pointer)))
            })
            .unzip();
        SweepPoint { values, places }
    }

    /// The point of a grid; the last axis runs fastest.
    fn grid_point(&self, index: usize) -> SweepPoint {
        self.point(|axis| {
            let faster: usize = self.0[axis + 1..].iter().map(|(_, values)| values.len()).product();
            index / faster % self.0[axis].1.len()
        })
    }

    fn common_length(&self) -> Result<usize, Violation> {
        let count = self.0.first().map_or(0, |(_, values)| values.len());
        match self.0.iter().find(|(_, values)| values.len() != count) {
            None => Ok(count),
            Some((pointer, values)) => {
                let detail = format!("axes of a zip are of one length; the first has {count} values");
                Err(Violation::new(axis_place(pointer), "range", detail, values.len(), count))
            }
        }
    }
}

fn listed_point(k: usize, values: &Object) -> SweepPoint {
    let place = |pointer: &String| format!("/sweep/points/{k}/{}", escape(pointer));
    SweepPoint {
        values: values.iter().map(|(pointer, value)| (pointer.clone(), value.clone())).collect(),
        places: values.keys().map(place).collect(),
    }
}

fn check_pointer(pointer: &str, at: &str, errors: &mut Vec<Violation>) {
    if !pointer.starts_with('/') || pointer.len() > LONGEST_POINTER {
        let detail = "an axis is a JSON pointer into the job's body";
        errors.push(Violation::new(at, "type", detail, pointer, "/scene/spacing, for instance"));
    }
}

/// Adds an error where a value is too large for ten thousand copies.
fn check_value(value: &Json, at: &str, errors: &mut Vec<Violation>) {
    // Numbers, the usual values, are not written out for that.
    if !value.is_number() && value.to_string().len() > LARGEST_VALUE {
        let detail = format!("a value of an axis has at most {LARGEST_VALUE} bytes");
        errors.push(Violation::new(at, "range", detail, Value::Null, LARGEST_VALUE));
    }
}

impl Parameter for Axes {
    type Domain = ();

    fn any() {}

    fn parse(given: &Json, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let Some(axes) = given.as_object().filter(|axes| !axes.is_empty()) else {
            let detail = "axes are an object from JSON pointers to lists of values";
            errors.push(Violation::new(place, "type", detail, given.clone(), Self::allowed(())));
            return None;
        };
        let before = errors.len();
        let mut lists = Vec::with_capacity(axes.len());
        for (pointer, values) in axes {
            let at = format!("{place}/{}", escape(pointer));
            check_pointer(pointer, &at, errors);
            let Some(values) = values.as_array().filter(|values| !values.is_empty()) else {
                let detail = "an axis has a list of values";
                errors.push(Violation::new(at, "type", detail, values.clone(), json!([0.02, 0.01])));
                continue;
            };
            for (k, value) in values.iter().enumerate() {
                check_value(value, &format!("{at}/{k}"), errors);
            }
            lists.push((pointer.clone(), values.clone()));
        }
        (errors.len() == before).then_some(Self(lists))
    }

    fn allowed((): ()) -> Json {
        json!({"/scene/spacing": [0.02, 0.01]})
    }

    fn schema((): ()) -> Object {
        let list = json!({"type": "array", "minItems": 1, "items": {}});
        Map::from_iter([
            ("type".to_owned(), json!("object")),
            ("additionalProperties".to_owned(), list),
            ("minProperties".to_owned(), json!(1)),
        ])
    }

    fn to_json(&self) -> Json {
        Json::Object(self.0.iter().map(|(pointer, values)| (pointer.clone(), json!(values))).collect())
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
