//! Shapes that are known exactly: plain ones, and those that are composed of others.

use super::members::{Member, Members};
use super::plain::PlainShape;
use crate::formulas::{FormulaText, NamedNumbers, constants};
use crate::geometry::Vector;
use crate::geometry::formula_level::FormulaLevel;
use crate::geometry::surfaces::{ImplicitSurface, Placement, Solid, SolidError, Surface};
use crate::spec::{AtLeast, Coordinates, POSITIVE, Parameter, Violation};
use serde_json::{Value, json};
use std::sync::Arc;

/// Half the edge of the box about the origin in which the zero of a level is searched, where none is given.
const BOX: f64 = 2.0;
/// Plain shapes in one shape at most.
const MOST_SHAPES: usize = 64;

crate::group! {
    /// A rotation about the origin.
    pub struct Rotation {
        /// angle in rad: counterclockwise in the plane, by the right-hand rule about the axis in space
        angle: f64;
        /// direction of the axis, of any length (3D); z when not given
        axis: Option<Coordinates>;
    }
}

crate::choice! {
    /// A shape that is known exactly.
    pub enum KnownShape {
        ..Plain(PlainShape)
        /// separate shapes taken together
        Union = "union" {
            /// the shapes; they must not overlap
            of: Vec<PlainShape>, in AtLeast(1);
        }
        /// where a level of one's own is negative: a formula of x, y and z, which need not be a distance
        Formula = "formula" {
            /// the level
            level: FormulaText;
            /// numbers that the formula calls by name
            parameters: NamedNumbers = constants();
            /// lower corner of a box that contains the shape; −2 along every axis when not given
            low: Option<Coordinates>;
            /// upper corner of that box; 2 along every axis when not given
            high: Option<Coordinates>;
        }
        /// what lies in all of several shapes
        Intersection = "intersection" {
            /// the shapes
            of: Members<KnownShape>;
        }
        /// a shape without the parts that lie in others
        Difference = "difference" {
            /// the shape that parts are taken from
            from: Member<KnownShape>;
            /// the shapes that are taken away
            minus: Members<KnownShape>;
        }
        /// everything outside a shape
        Complement = "complement" {
            /// the shape
            of: Member<KnownShape>;
        }
        /// a shape that is rotated about the origin, then scaled, then moved
        Transformed = "transformed" {
            /// the shape
            of: Member<KnownShape>;
            /// rotation; none when not given
            rotate: Option<Rotation>;
            /// factor of all lengths
            scale: f64 = 1.0, in POSITIVE;
            /// translation; none when not given
            translate: Option<Coordinates>;
        }
    }
}

/// The surface of a shape. Copies share it.
#[derive(Clone)]
pub struct ShapeSurface<const D: usize> {
    /// The whole surface.
    pub whole: Arc<dyn Surface<D>>,
    /// Its separate parts: those of a union, else the whole.
    pub parts: Vec<Arc<dyn Surface<D>>>,
}

impl<const D: usize> ShapeSurface<D> {
    /// A surface of one part.
    #[must_use]
    pub fn single(whole: Arc<dyn Surface<D>>) -> Self {
        Self { parts: vec![Arc::clone(&whole)], whole }
    }

    /// The whole surface for an owner.
    #[must_use]
    pub fn boxed(&self) -> Box<dyn Surface<D>> {
        Box::new(Arc::clone(&self.whole))
    }

    /// The parts for an owner.
    #[must_use]
    pub fn boxed_parts(&self) -> Vec<Box<dyn Surface<D>>> {
        self.parts.iter().map(|part| -> Box<dyn Surface<D>> { Box::new(Arc::clone(part)) }).collect()
    }
}

impl KnownShape {
    /// The dimension that the shape implies: by its type, else by the length of its vectors.
    pub(super) fn dimension(&self) -> Option<usize> {
        let of_all = |members: &Members<KnownShape>| members.0.iter().find_map(Self::dimension);
        match self {
            Self::Plain(shape) => shape.dimension(),
            Self::Union { of } => of.iter().find_map(PlainShape::dimension),
            Self::Formula { low, high, .. } => low.as_ref().or(high.as_ref()).map(|corner| corner.len()),
            Self::Intersection { of } => of_all(of),
            Self::Difference { from, minus } => from.0.dimension().or_else(|| of_all(minus)),
            Self::Complement { of } => of.0.dimension(),
            Self::Transformed { of, translate, .. } => {
                of.0.dimension().or_else(|| translate.as_ref().map(|numbers| numbers.len()))
            }
        }
    }

    /// The surface of the shape in `D` dimensions. Pointers of errors begin with `pointer`.
    ///
    /// # Errors
    /// Everything that does not fit together, and shapes of which nothing is left.
    pub(super) fn surface<const D: usize>(&self, pointer: &str) -> Result<ShapeSurface<D>, Vec<Violation>> {
        let count = self.count();
        if count > MOST_SHAPES {
            let detail = "the shape is composed of too many shapes";
            let allowed = json!(format!("{MOST_SHAPES} at most"));
            return Err(vec![Violation::new(pointer, "range", detail, count, allowed)]);
        }
        let mut errors = Vec::new();
        let solid = self.solid::<D>(pointer, &mut errors);
        let Some(solid) = solid.filter(|_| errors.is_empty()) else { return Err(errors) };
        let whole = solid.surface().map_err(|error| vec![self.refused(pointer, &error)])?;
        let parts = solid.parts().unwrap_or_default();
        Ok(if parts.len() > 1 { ShapeSurface { whole, parts } } else { ShapeSurface::single(whole) })
    }

    /// The violation of a shape without a surface.
    fn refused(&self, pointer: &str, error: &SolidError) -> Violation {
        let (at, got) = match (error, self) {
            (SolidError::Overlap(_), Self::Union { of }) => (format!("{pointer}/of"), of.to_json()),
            _ => (pointer.to_owned(), self.to_json()),
        };
        Violation::new(at, "conflict", error.to_string(), got, Value::Null)
    }

    /// Number of plain shapes.
    fn count(&self) -> usize {
        let of_all = |members: &Members<KnownShape>| members.0.iter().map(Self::count).sum::<usize>();
        match self {
            Self::Plain(_) | Self::Formula { .. } => 1,
            Self::Union { of } => of.len(),
            Self::Intersection { of } => of_all(of),
            Self::Difference { from, minus } => from.0.count() + of_all(minus),
            Self::Complement { of } | Self::Transformed { of, .. } => of.0.count(),
        }
    }

    /// The solid of the shape; None where errors were found.
    fn solid<const D: usize>(&self, pointer: &str, errors: &mut Vec<Violation>) -> Option<Solid<D>> {
        match self {
            Self::Plain(shape) => plain_solid(shape, pointer, errors),
            Self::Union { of } => {
                let solids: Vec<Option<Solid<D>>> = of
                    .iter()
                    .enumerate()
                    .map(|(k, part)| plain_solid(part, &format!("{pointer}/of/{k}"), errors))
                    .collect();
                let union = Solid::Union(solids.into_iter().collect::<Option<Vec<_>>>()?);
                // Its parts must not overlap, whatever it is a member of.
                union.surface().map_err(|error| errors.push(self.refused(pointer, &error))).ok()?;
                Some(union)
            }
            Self::Formula { .. } => self.implicit::<D>(pointer).map_err(|found| errors.extend(found)).ok(),
            Self::Intersection { of } => Some(Solid::Intersection(solids_of(of, &format!("{pointer}/of"), errors)?)),
            Self::Difference { from, minus } => {
                let from = from.0.solid::<D>(&format!("{pointer}/from"), errors);
                let minus = solids_of(minus, &format!("{pointer}/minus"), errors);
                let outside = |solid| Solid::Complement(Box::new(solid));
                Some(Solid::Intersection(std::iter::once(from?).chain(minus?.into_iter().map(outside)).collect()))
            }
            Self::Complement { of } => {
                let solid = of.0.solid::<D>(&format!("{pointer}/of"), errors)?;
                Some(Solid::Complement(Box::new(solid)))
            }
            Self::Transformed { of, rotate, scale, translate } => {
                let solid = of.0.solid::<D>(&format!("{pointer}/of"), errors);
                let placement = placement(rotate.as_ref(), *scale, translate.as_ref(), pointer, errors);
                Some(solid?.placed(&placement?))
            }
        }
    }
}

impl KnownShape {
    /// The solid of a formula.
    fn implicit<const D: usize>(&self, pointer: &str) -> Result<Solid<D>, Vec<Violation>> {
        let Self::Formula { level, parameters, low, high } = self else { return Err(Vec::new()) };
        let mut errors = Vec::new();
        let mut corner = |name: &str, given: &Option<Coordinates>, otherwise: f64| {
            let at = format!("{pointer}/{name}");
            given.as_ref().map_or_else(|| Vector::<D>::repeat(otherwise), |numbers| vector(&at, numbers, &mut errors))
        };
        let (low_corner, high_corner) = (corner("low", low, -BOX), corner("high", high, BOX));
        if errors.is_empty() && (high_corner - low_corner).min() <= 0.0 {
            let detail = "the upper corner of the box is not above the lower one along every axis";
            errors.push(Violation::new(format!("{pointer}/high"), "range", detail, high.to_json(), low.to_json()));
        }
        let level_function = FormulaLevel::<D>::new(level, parameters, pointer);
        let level_function = level_function.map_err(|found| errors.extend(found)).ok();
        let Some(level_function) = level_function.filter(|_| errors.is_empty()) else { return Err(errors) };
        let surface = ImplicitSurface::new(Arc::new(level_function), low_corner, high_corner).map_err(|error| {
            vec![Violation::new(
                format!("{pointer}/level"),
                "conflict",
                error.to_string(),
                level.to_json(),
                Value::Null,
            )]
        })?;
        Ok(Solid::Shape(Arc::new(surface)))
    }
}

fn plain_solid<const D: usize>(shape: &PlainShape, pointer: &str, errors: &mut Vec<Violation>) -> Option<Solid<D>> {
    shape.surface::<D>(pointer).map(Solid::Shape).map_err(|found| errors.extend(found)).ok()
}

/// The solids of all members; None where errors were found in any.
fn solids_of<const D: usize>(
    members: &Members<KnownShape>,
    pointer: &str,
    errors: &mut Vec<Violation>,
) -> Option<Vec<Solid<D>>> {
    let all: Vec<Option<Solid<D>>> =
        members.0.iter().enumerate().map(|(k, member)| member.solid::<D>(&format!("{pointer}/{k}"), errors)).collect();
    all.into_iter().collect()
}

/// A vector of the scene's dimension.
fn vector<const D: usize>(pointer: &str, numbers: &Coordinates, errors: &mut Vec<Violation>) -> Vector<D> {
    if numbers.len() != D {
        let detail = format!("the scene has {D} dimensions");
        errors.push(Violation::new(pointer, "conflict", detail, numbers.to_json(), json!(format!("{D} numbers"))));
    }
    Vector::<D>::from_fn(|d, _| numbers.get(d).copied().unwrap_or(0.0))
}

/// The map of a transformed shape.
fn placement<const D: usize>(
    rotate: Option<&Rotation>,
    scale: f64,
    translate: Option<&Coordinates>,
    pointer: &str,
    errors: &mut Vec<Violation>,
) -> Option<Placement<D>> {
    let before = errors.len();
    let shift =
        translate.map_or_else(Vector::<D>::zeros, |numbers| vector(&format!("{pointer}/translate"), numbers, errors));
    let mut axis = Vector::<D>::zeros();
    axis[D - 1] = 1.0;
    if let Some(numbers) = rotate.and_then(|rotation| rotation.axis.as_ref()) {
        let at = format!("{pointer}/rotate/axis");
        if D == 2 {
            let detail = "a rotation in the plane has no axis";
            errors.push(Violation::new(at, "conflict", detail, numbers.to_json(), Value::Null));
        } else {
            match vector::<D>(&at, numbers, errors).try_normalize(0.0) {
                Some(direction) => axis = direction,
                None => {
                    let allowed = json!("numbers that are not all 0");
                    errors.push(Violation::new(at, "range", "the axis has no direction", numbers.to_json(), allowed));
                }
            }
        }
    }
    let rotation = Placement::rotation(rotate.map_or(0.0, |rotation| rotation.angle), &axis);
    (errors.len() == before).then_some(Placement { rotation, scale, shift })
}
