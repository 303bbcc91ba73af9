//! Fields on a surface as parameters.

use crate::formulas::{FormulaText, NamedNumbers, constants};
use crate::scene::cloud::PointsSource;
use crate::spec::{Coordinates, Interval, Object, POSITIVE, Parameter, Violation, whole};
use serde_json::{Value, json};

crate::words! {
    /// An axis of coordinates.
    pub enum AxisWord {
        /// x
        X = "x",
        /// y
        Y = "y",
        /// z
        Z = "z",
    }
}

crate::choice! {
    /// A field of one's own.
    pub enum OwnField {
        /// a formula of x, y, z and of the unit normal nx, ny, nz
        Formula = "formula" {
            /// the value
            value: FormulaText;
            /// numbers that the formula calls by name
            parameters: NamedNumbers = constants();
        }
        /// values at the points: those of the file of the surface, or an upload `as=values` in the order of its points
        Data = "data" {
            /// name of the values; it may be left out where there are no others
            name: Option<String>;
            /// another file with the values; that of the surface when not given
            source: PointsSource => flatten;
        }
    }
}

crate::choice! {
    /// A field on a surface.
    pub enum FieldChoice {
        ..Own(OwnField)
        /// real orthonormal Y_lm, on a sphere: m > 0 ∝ cos mφ, m < 0 ∝ sin |m|φ
        SphericalHarmonic = "spherical_harmonic" {
            /// degree
            l: u32 = 4, in whole(1, 64);
            /// order, a whole number from −l to l
            m: f64 = 0.0, in Interval::at_least(-64.0).and_at_most(64.0);
            /// the axis that angles are measured about
            axis: AxisWord = AxisWord::Z;
        }
        /// sin(k·x), on any surface
        PlaneWave = "plane_wave" {
            /// wave vector; when not given, (2, −1, 3) by the extent of the surface
            k: Option<Coordinates>;
        }
        /// sin mθ + cos mθ, on a circle
        SinPlusCos = "sin_plus_cos" {
            /// wave number, half the number of points at most
            m: u64 = 1, in whole(1, 100_000_000);
        }
    }
}

crate::choice! {
    /// A field at the start.
    pub enum InitialChoice {
        ..Field(FieldChoice)
        /// ζ(|x − c|/σ)/σ² with ζ(d) = exp(−1/(1 − d²)) below d = 0.975 (Surface DC-PSE paper, section 4.4)
        TruncatedGaussian = "truncated_gaussian" {
            /// center c
            center: Coordinates = [0.0, 0.0, 0.0].into();
            /// width σ
            sigma: f64 = 0.2, in POSITIVE;
        }
    }
}

/// A number, a formula, or a field of one's own.
#[derive(Debug, Clone, PartialEq)]
pub enum FieldValue {
    /// A formula of the place; a number stands for itself.
    Text(FormulaText),
    /// A formula with its own numbers, or data.
    Own(OwnField),
}

/// The same number everywhere.
#[must_use]
pub fn everywhere(number: f64) -> FieldValue {
    FieldValue::Text(FormulaText(number.to_string()))
}

impl FieldValue {
    /// The number, where the value is the same everywhere and written as one.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        let Self::Text(FormulaText(text)) = self else { return None };
        text.parse().ok().filter(|number: &f64| number.is_finite())
    }
}

impl Parameter for FieldValue {
    type Domain = ();

    fn any() {}

    fn parse(given: &Value, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        if given.is_object() {
            OwnField::parse(given, (), place, errors).map(Self::Own)
        } else {
            FormulaText::parse(given, (), place, errors).map(Self::Text)
        }
    }

    fn allowed((): ()) -> Value {
        json!("a number, a formula, {\"type\": \"formula\", …} or {\"type\": \"data\", …}")
    }

    fn schema((): ()) -> Object {
        let kinds = json!([FormulaText::schema(()), OwnField::schema(())]);
        Object::from_iter([("anyOf".to_owned(), kinds)])
    }

    fn to_json(&self) -> Value {
        match (self.number(), self) {
            (Some(number), _) => json!(number),
            (None, Self::Text(text)) => text.to_json(),
            (None, Self::Own(field)) => field.to_json(),
        }
    }
}
