//! What varies: pointers into a job's body with their values, and the points that these make.

use meniscus::spec::{Json, Object, Parameter, Violation, escape};
use serde_json::{Map, Value, json};

/// Bytes of a value of an axis at most: there may be ten thousand copies of it.
const LARGEST_VALUE: usize = 16 << 10;
/// Bytes of a pointer at most.
const LONGEST_POINTER: usize = 200;

/// A point: its values by pointer, and where each of them stands in the sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepPoint {
    /// Values by pointer.
    pub values: Vec<(String, Json)>,
    /// Pointers to the values in the study's body.
    pub places: Vec<String>,
}

/// A JSON pointer into the job's body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pointer(pub String);

impl Parameter for Pointer {
    type Domain = ();

    fn any() {}

    fn parse(given: &Json, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let before = errors.len();
        let pointer = given.as_str().unwrap_or_default();
        check_pointer(pointer, place, errors);
        (errors.len() == before).then(|| Self(pointer.to_owned()))
    }

    fn allowed((): ()) -> Json {
        json!("/scene/spacing, for instance")
    }

    fn schema((): ()) -> Object {
        Map::from_iter([("type".to_owned(), json!("string")), ("pattern".to_owned(), json!("^/"))])
    }

    fn to_json(&self) -> Json {
        json!(self.0)
    }
}

/// Lists of values by pointer.
#[derive(Debug, Clone, PartialEq)]
pub struct Axes(pub(super) Vec<(String, Vec<Json>)>);

/// Where the axes of a grid or a zip stand in the body of a study.
pub(super) const AXES: &str = "/sweep/axes";

fn axis_place(pointer: &str) -> String {
    format!("{AXES}/{}", escape(pointer))
}

impl Axes {
    /// The pointers.
    pub(super) fn pointers(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(|(pointer, _)| pointer.as_str())
    }

    /// Every combination of the values, `most` at most; the last axis runs fastest. `place` is where the axes stand.
    pub(super) fn grid(&self, place: &str, most: usize) -> Vec<SweepPoint> {
        let count = self.0.iter().map(|(_, values)| values.len()).fold(1_usize, usize::saturating_mul);
        (0..count.min(most)).map(|index| self.grid_point(place, index)).collect()
    }

    /// The point with the `index_of(axis)`-th value of each axis.
    pub(super) fn point(&self, place: &str, index_of: impl Fn(usize) -> usize) -> SweepPoint {
        let indices = (0..self.0.len()).map(index_of);
        let (values, places) = self
            .0
            .iter()
            .zip(indices)
            .map(|((pointer, values), k)| {
                ((pointer.clone(), values[k].clone()), format!("{place}/{}/{k}", escape(pointer)))
            })
            .unzip();
        SweepPoint { values, places }
    }

    /// The point of a grid; the last axis runs fastest.
    fn grid_point(&self, place: &str, index: usize) -> SweepPoint {
        self.point(place, |axis| {
            let faster: usize = self.0[axis + 1..].iter().map(|(_, values)| values.len()).product();
            index / faster % self.0[axis].1.len()
        })
    }

    /// Number of values of every axis.
    ///
    /// # Errors
    /// Where the axes differ in it.
    pub(super) fn common_length(&self) -> Result<usize, Violation> {
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

/// Adds an error where a text is no pointer into a job's body.
pub(super) fn check_pointer(pointer: &str, at: &str, errors: &mut Vec<Violation>) {
    if !pointer.starts_with('/') || pointer.len() > LONGEST_POINTER {
        let detail = "an axis is a JSON pointer into the job's body";
        errors.push(Violation::new(at, "type", detail, pointer, "/scene/spacing, for instance"));
    }
}

/// Adds an error where a value is too large for ten thousand copies.
pub(super) fn check_value(value: &Json, at: &str, errors: &mut Vec<Violation>) {
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
