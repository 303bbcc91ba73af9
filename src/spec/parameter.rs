//! Types that a declared parameter can have, and the ranges that restrict them.

use super::violation::Violation;
use serde_json::{Map, Value, json};
use std::ops::Deref;

/// A type that a declared parameter can have: how its JSON is read, written and described.
pub trait Parameter: Sized + Clone {
    /// What restricts the values of the type: a range of numbers, a least length, nothing.
    type Domain: Copy;

    /// Whether an absent value and null mean the same (`Option`).
    const IS_OPTIONAL: bool = false;

    /// The domain without restrictions.
    fn any() -> Self::Domain;

    /// Reads a value. Everything that is wrong with it is added to `errors`, with pointers that begin with `place`.
    fn parse(given: &Value, domain: Self::Domain, place: &str, errors: &mut Vec<Violation>) -> Option<Self>;

    /// The accepted values, for people.
    fn allowed(domain: Self::Domain) -> Value;

    /// The accepted values as JSON Schema 2020-12.
    fn schema(domain: Self::Domain) -> Map<String, Value>;

    /// The value as JSON.
    fn to_json(&self) -> Value;
}

/// A range of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Interval {
    above: Option<f64>,
    least: Option<f64>,
    below: Option<f64>,
    most: Option<f64>,
}

/// Numbers greater than zero.
pub const POSITIVE: Interval = Interval::above(0.0);
/// Numbers not less than zero.
pub const NOT_NEGATIVE: Interval = Interval::at_least(0.0);

impl Interval {
    /// All numbers.
    pub const ANY: Self = Self { above: None, least: None, below: None, most: None };

    /// Numbers greater than `bound`.
    #[must_use]
    pub const fn above(bound: f64) -> Self {
        Self { above: Some(bound), ..Self::ANY }
    }

    /// Numbers not less than `bound`.
    #[must_use]
    pub const fn at_least(bound: f64) -> Self {
        Self { least: Some(bound), ..Self::ANY }
    }

    /// Numbers not greater than `bound`.
    #[must_use]
    pub const fn at_most(bound: f64) -> Self {
        Self { most: Some(bound), ..Self::ANY }
    }

    /// Those of the range that are less than `bound`.
    #[must_use]
    pub const fn and_below(self, bound: f64) -> Self {
        Self { below: Some(bound), ..self }
    }

    /// Those of the range that are not greater than `bound`.
    #[must_use]
    pub const fn and_at_most(self, bound: f64) -> Self {
        Self { most: Some(bound), ..self }
    }

    fn contains(&self, number: f64) -> bool {
        self.above.is_none_or(|bound| number > bound)
            && self.least.is_none_or(|bound| number >= bound)
            && self.below.is_none_or(|bound| number < bound)
            && self.most.is_none_or(|bound| number <= bound)
    }
}

impl Parameter for f64 {
    type Domain = Interval;

    fn any() -> Interval {
        Interval::ANY
    }

    fn parse(given: &Value, domain: Interval, place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let found = given.as_f64();
        if let Some(number) = found.filter(|number| domain.contains(*number)) {
            return Some(number);
        }
        let (code, detail) =
            if found.is_some() { ("range", "the number is out of range") } else { ("type", "a number is needed") };
        errors.push(Violation::new(place, code, detail, given.clone(), Self::allowed(domain)));
        None
    }

    fn allowed(domain: Interval) -> Value {
        let mut bounds = Vec::new();
        bounds.extend(domain.above.map(|bound| format!("> {bound}")));
        bounds.extend(domain.least.map(|bound| format!("≥ {bound}")));
        bounds.extend(domain.below.map(|bound| format!("< {bound}")));
        bounds.extend(domain.most.map(|bound| format!("≤ {bound}")));
        if bounds.is_empty() { json!("a number") } else { json!(format!("a number {}", bounds.join(" and "))) }
    }

    fn schema(domain: Interval) -> Map<String, Value> {
        let bounds = [
            ("exclusiveMinimum", domain.above),
            ("minimum", domain.least),
            ("exclusiveMaximum", domain.below),
            ("maximum", domain.most),
        ];
        let mut schema = keyword("type", "number");
        schema.extend(bounds.into_iter().filter_map(|(name, bound)| Some((name.to_owned(), json!(bound?)))));
        schema
    }

    fn to_json(&self) -> Value {
        json!(self)
    }
}

/// A range of whole numbers, both ends included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Whole {
    /// The least one.
    pub least: u64,
    /// The largest one; `u64::MAX` stands for no bound.
    pub most: u64,
}

/// Whole numbers from `least` to `most`.
#[must_use]
pub const fn whole(least: u64, most: u64) -> Whole {
    Whole { least, most }
}

/// A whole number as it may be written: 240 or 240.0.
fn whole_number(given: &Value) -> Option<u64> {
    /// The largest number that JSON's doubles tell from its neighbors.
    const LARGEST: f64 = 9e15;
    let by_value = |x: &f64| x.fract() == 0.0 && *x >= 0.0 && *x < LARGEST;
    given.as_u64().or_else(|| given.as_f64().filter(by_value).map(|x| x as u64))
}

impl Parameter for u64 {
    type Domain = Whole;

    fn any() -> Whole {
        whole(0, Self::MAX)
    }

    fn parse(given: &Value, domain: Whole, place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let found = whole_number(given);
        if let Some(number) = found.filter(|number| (domain.least..=domain.most).contains(number)) {
            return Some(number);
        }
        let (code, detail) = if found.is_some() {
            ("range", "the number is out of range")
        } else {
            ("type", "a whole number is needed")
        };
        errors.push(Violation::new(place, code, detail, given.clone(), Self::allowed(domain)));
        None
    }

    fn allowed(Whole { least, most }: Whole) -> Value {
        if most == Self::MAX {
            return json!(format!("a whole number ≥ {least}"));
        }
        json!(format!("a whole number from {least} to {most}"))
    }

    fn schema(Whole { least, most }: Whole) -> Map<String, Value> {
        let mut schema = keyword("type", "integer");
        schema.insert("minimum".into(), json!(least));
        if most != Self::MAX {
            schema.insert("maximum".into(), json!(most));
        }
        schema
    }

    fn to_json(&self) -> Value {
        json!(self)
    }
}

/// Smaller whole numbers are read as `u64`, restricted to what they can hold.
macro_rules! narrow_whole_numbers {
    ($($type:ty),*) => {$(
        impl Parameter for $type {
            type Domain = Whole;

            fn any() -> Whole {
                whole(0, <$type>::MAX as u64)
            }

            fn parse(given: &Value, domain: Whole, place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
                u64::parse(given, domain, place, errors).and_then(|number| Self::try_from(number).ok())
            }

            fn allowed(domain: Whole) -> Value {
                u64::allowed(domain)
            }

            fn schema(domain: Whole) -> Map<String, Value> {
                u64::schema(domain)
            }

            fn to_json(&self) -> Value {
                json!(self)
            }
        }
    )*};
}

narrow_whole_numbers!(u32, usize);

impl Parameter for bool {
    type Domain = ();

    fn any() {}

    fn parse(given: &Value, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        if given.as_bool().is_none() {
            errors.push(Violation::new(place, "type", "true or false is needed", given.clone(), Self::allowed(())));
        }
        given.as_bool()
    }

    fn allowed((): ()) -> Value {
        json!([true, false])
    }

    fn schema((): ()) -> Map<String, Value> {
        keyword("type", "boolean")
    }

    fn to_json(&self) -> Value {
        json!(self)
    }
}

impl Parameter for String {
    type Domain = ();

    fn any() {}

    fn parse(given: &Value, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let text = given.as_str().filter(|text| !text.is_empty());
        if text.is_none() {
            errors.push(Violation::new(place, "type", "a text is needed", given.clone(), Self::allowed(())));
        }
        text.map(str::to_owned)
    }

    fn allowed((): ()) -> Value {
        json!("a text")
    }

    fn schema((): ()) -> Map<String, Value> {
        let mut schema = keyword("type", "string");
        schema.insert("minLength".into(), json!(1));
        schema
    }

    fn to_json(&self) -> Value {
        json!(self)
    }
}

/// Two or three numbers: a place, a vector or edge lengths, by the dimension of the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Coordinates(pub Vec<f64>);

impl<const N: usize> From<[f64; N]> for Coordinates {
    fn from(numbers: [f64; N]) -> Self {
        Self(numbers.to_vec())
    }
}

impl Deref for Coordinates {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.0
    }
}

/// Signs that coordinates may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sign {
    /// Any.
    Any,
    /// Every number is greater than zero.
    Positive,
}

impl Parameter for Coordinates {
    type Domain = Sign;

    fn any() -> Sign {
        Sign::Any
    }

    fn parse(given: &Value, domain: Sign, place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let numbers: Option<Vec<f64>> = given.as_array().and_then(|list| list.iter().map(Value::as_f64).collect());
        let numbers = numbers.filter(|numbers| numbers.len() == 2 || numbers.len() == 3);
        let (code, detail) = match numbers {
            None => ("type", "a list of two or three numbers is needed"),
            Some(numbers) if domain == Sign::Positive && numbers.iter().any(|x| *x <= 0.0) => {
                ("range", "every number must be positive")
            }
            Some(numbers) => return Some(Self(numbers)),
        };
        errors.push(Violation::new(place, code, detail, given.clone(), Self::allowed(domain)));
        None
    }

    fn allowed(domain: Sign) -> Value {
        json!(if domain == Sign::Positive { "two or three positive numbers" } else { "two or three numbers" })
    }

    fn schema(domain: Sign) -> Map<String, Value> {
        let item = f64::schema(if domain == Sign::Positive { POSITIVE } else { Interval::ANY });
        let mut schema = keyword("type", "array");
        schema.insert("items".into(), Value::Object(item));
        schema.insert("minItems".into(), json!(2));
        schema.insert("maxItems".into(), json!(3));
        schema
    }

    fn to_json(&self) -> Value {
        json!(self.0)
    }
}

impl<T: Parameter> Parameter for Option<T> {
    type Domain = T::Domain;

    const IS_OPTIONAL: bool = true;

    fn any() -> T::Domain {
        T::any()
    }

    fn parse(given: &Value, domain: T::Domain, place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        if given.is_null() { Some(None) } else { T::parse(given, domain, place, errors).map(Some) }
    }

    fn allowed(domain: T::Domain) -> Value {
        T::allowed(domain)
    }

    fn schema(domain: T::Domain) -> Map<String, Value> {
        Map::from_iter([("anyOf".to_owned(), json!([T::schema(domain), {"type": "null"}]))])
    }

    fn to_json(&self) -> Value {
        self.as_ref().map_or(Value::Null, Parameter::to_json)
    }
}

/// JSON that is taken as it is, null included; a later step reads it. None where the field is absent.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Raw(pub Option<Value>);

impl Parameter for Raw {
    type Domain = ();

    fn any() {}

    fn parse(given: &Value, (): (), _: &str, _: &mut Vec<Violation>) -> Option<Self> {
        Some(Self(Some(given.clone())))
    }

    fn allowed((): ()) -> Value {
        Value::Null
    }

    fn schema((): ()) -> Map<String, Value> {
        Map::new()
    }

    fn to_json(&self) -> Value {
        self.0.clone().unwrap_or_default()
    }
}

/// A schema of one keyword.
pub(super) fn keyword(name: &str, value: impl Into<Value>) -> Map<String, Value> {
    Map::from_iter([(name.to_owned(), value.into())])
}

#[cfg(test)]
mod tests {
    use super::{Coordinates, Interval, POSITIVE, Parameter, Sign, whole};
    use serde_json::{Value, json};

    fn code<T: Parameter>(given: &Value, domain: T::Domain) -> Option<&'static str> {
        let mut errors = Vec::new();
        let found = T::parse(given, domain, "/x", &mut errors);
        assert_eq!(found.is_none(), errors.len() == 1, "a value or one error: {given}");
        errors.pop().map(|error| error.code)
    }

    #[test]
    fn ranges_are_kept_at_their_ends() {
        let half_open = Interval::at_least(0.0).and_below(0.5);
        assert_eq!(code::<f64>(&json!(0), half_open), None);
        assert_eq!(code::<f64>(&json!(0.5), half_open), Some("range"));
        assert_eq!(code::<f64>(&json!(0), POSITIVE), Some("range"));
        assert_eq!(code::<f64>(&json!("1"), POSITIVE), Some("type"));
        assert_eq!(f64::allowed(half_open), json!("a number ≥ 0 and < 0.5"));
    }

    #[test]
    fn whole_numbers_may_be_written_with_a_point() {
        assert_eq!(code::<u64>(&json!(240.0), whole(1, 1000)), None);
        assert_eq!(code::<u64>(&json!(2.5), whole(1, 1000)), Some("type"));
        assert_eq!(code::<u64>(&json!(-1), whole(1, 1000)), Some("type"));
        assert_eq!(code::<usize>(&json!(1001), whole(1, 1000)), Some("range"));
    }

    #[test]
    fn coordinates_are_two_or_three_numbers() {
        assert_eq!(code::<Coordinates>(&json!([1, 2]), Sign::Any), None);
        assert_eq!(code::<Coordinates>(&json!([1]), Sign::Any), Some("type"));
        assert_eq!(code::<Coordinates>(&json!([1, -2]), Sign::Positive), Some("range"));
    }

    #[test]
    fn null_is_an_absent_optional() {
        assert_eq!(code::<Option<f64>>(&Value::Null, POSITIVE), None);
        assert_eq!(code::<Option<f64>>(&json!(-1), POSITIVE), Some("range"));
        assert_eq!(code::<f64>(&Value::Null, POSITIVE), Some("type"));
    }
}
