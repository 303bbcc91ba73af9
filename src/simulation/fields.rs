//! What a frame shows: points in space with named values.

use super::quantity::{Quantity, quantities};
use crate::closest_point::SurfaceColumns;
use crate::geometry::Vector;
use crate::particles::{Particles, ScalarKey, VectorKey};

quantities! {
    /// Fields that every scheme shows whose particles know a surface.
    pub SURFACE_FIELDS {
        PHI = "phi", "length", "Signed distance from the surface, positive outside; NaN outside the narrow band.";
        CLOSEST_POINT = "closest_point", "length", "Closest point of the surface; NaN outside the narrow band.";
        NORMAL = "normal", "", "Unit normal of the surface, outward; NaN where it is not known.";
        CURVATURE = "curvature", "1/length", "Divergence of the unit normal at the closest point; NaN where it is not known.";
    }
}

quantities! {
    /// Fields that every scheme has.
    pub COMMON_FIELDS {
        PARTICLE_ID = "particle_id", "", "Number of the particle, from 0.";
    }
}

/// Which fields are wanted.
#[derive(Debug, Clone, Copy)]
pub enum Selection<'a> {
    /// Every declared field.
    All,
    /// Those of these names.
    Named(&'a [String]),
}

impl Selection<'_> {
    /// Whether a field is wanted.
    #[must_use]
    pub fn has(&self, quantity: &Quantity) -> bool {
        match self {
            Self::All => true,
            Self::Named(names) => names.iter().any(|name| name == quantity.name),
        }
    }
}

/// Points and the values of the selected fields at one moment. 2D points have z = 0.
#[derive(Debug, Clone)]
pub struct Fields<'a> {
    /// Positions of the points; z = 0 in the plane.
    pub points: Vec<[f64; 3]>,
    /// Values at the points, field by field.
    pub columns: Vec<Field>,
    /// Points that findings are about.
    pub marks: Vec<Mark>,
    /// Triangles between the points, by the indices of their corners; empty where points are not those of one surface.
    pub triangles: Vec<[u32; 3]>,
    selection: Selection<'a>,
}

/// Points that a finding is about.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mark {
    /// Code of the finding.
    pub code: &'static str,
    /// Indices of the points.
    pub points: Vec<usize>,
}

/// One named field.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Name, as the scheme declares it.
    pub name: &'static str,
    /// One value a point.
    pub values: FieldValues,
}

/// A field of a scheme: its quantity, when frames show it, and how its values are computed. A scheme lists its fields in
/// one table, so that a new field is one entry.
///
/// `C` is the choice that decides which fields there are, known before a run; `S` is the state that frames show.
pub struct FrameField<C, S> {
    quantity: &'static Quantity,
    /// None for a field of every frame.
    is_shown: Option<fn(&C) -> bool>,
    values: fn(&S) -> FieldValues,
}

impl<C, S> FrameField<C, S> {
    /// A field of every frame.
    #[must_use]
    pub fn new(quantity: &'static Quantity, values: fn(&S) -> FieldValues) -> Self {
        Self { quantity, is_shown: None, values }
    }

    /// The same field, but only with certain choices.
    #[must_use]
    pub fn only_if(self, is_shown: fn(&C) -> bool) -> Self {
        Self { is_shown: Some(is_shown), ..self }
    }
}

/// The quantities of all fields of a table.
#[must_use]
pub fn quantities_of<C, S>(table: &[FrameField<C, S>]) -> Vec<&'static Quantity> {
    table.iter().map(|field| field.quantity).collect()
}

/// The quantities of those fields of a table that every frame shows.
#[must_use]
pub fn always_shown<C, S>(table: &[FrameField<C, S>]) -> Vec<&'static Quantity> {
    table.iter().filter(|field| field.is_shown.is_none()).map(|field| field.quantity).collect()
}

/// The quantities of those fields of a table that frames show because of a choice.
#[must_use]
pub fn shown_by_choice<C, S>(table: &[FrameField<C, S>], choice: &C) -> Vec<&'static Quantity> {
    let is_chosen = |field: &&FrameField<C, S>| field.is_shown.is_some_and(|is_shown| is_shown(choice));
    table.iter().filter(is_chosen).map(|field| field.quantity).collect()
}

/// The values of a field.
#[derive(Debug, Clone, PartialEq)]
pub enum FieldValues {
    /// One number at each point.
    Scalar(Vec<f64>),
    /// Vectors, z = 0 in 2D.
    Vector(Vec<[f64; 3]>),
    /// One whole number at each point.
    Id(Vec<u64>),
}

impl FieldValues {
    /// Vectors of a space of D dimensions.
    #[must_use]
    pub fn vectors<const D: usize>(values: impl Iterator<Item = Vector<D>>) -> Self {
        Self::Vector(values.map(|v| embed(&v)).collect())
    }
}

/// A vector with its missing components set to zero.
#[must_use]
pub fn embed<const D: usize>(x: &Vector<D>) -> [f64; 3] {
    std::array::from_fn(|d| if d < D { x[d] } else { 0.0 })
}

impl<'a> Fields<'a> {
    /// Points without fields.
    #[must_use]
    pub fn new<const D: usize>(points: &[Vector<D>], selection: Selection<'a>) -> Self {
        Self {
            points: points.iter().map(embed).collect(),
            columns: Vec::new(),
            marks: Vec::new(),
            triangles: Vec::new(),
            selection,
        }
    }

    /// Adds numbers, if they are wanted.
    pub fn scalar(&mut self, quantity: &'static Quantity, values: impl FnOnce() -> Vec<f64>) {
        self.add(quantity, || FieldValues::Scalar(values()));
    }

    /// Adds vectors, if they are wanted.
    pub fn vector<const D: usize, I: Iterator<Item = Vector<D>>>(
        &mut self,
        quantity: &'static Quantity,
        values: impl FnOnce() -> I,
    ) {
        self.add(quantity, || FieldValues::vectors(values()));
    }

    /// Adds the fields of a scheme's table that frames show with a choice, if they are wanted.
    pub fn add_table<C, S>(&mut self, table: &[FrameField<C, S>], choice: &C, state: &S) {
        for field in table.iter().filter(|field| field.is_shown.is_none_or(|is_shown| is_shown(choice))) {
            self.add(field.quantity, || (field.values)(state));
        }
    }

    /// Adds the numbers of the particles, if they are wanted.
    pub fn particle_id(&mut self) {
        let count = self.points.len() as u64;
        self.add(&PARTICLE_ID, || FieldValues::Id((0..count).collect()));
    }

    fn add(&mut self, quantity: &'static Quantity, values: impl FnOnce() -> FieldValues) {
        if self.selection.has(quantity) {
            self.columns.push(Field { name: quantity.name, values: values() });
        }
    }

    /// Adds what particles know of the surface, NaN outside the narrow band and where nothing is known: everything but
    /// φ before the first redistancing (`is_redistanced` false), normal and curvature at corners (stored as zero).
    pub fn surface<const D: usize>(
        &mut self,
        particles: &Particles<D>,
        columns: &SurfaceColumns,
        is_redistanced: bool,
    ) {
        let band = particles.flag(columns.in_band);
        let bent: Vec<u8> = particles
            .vector(columns.normal)
            .iter()
            .zip(band)
            .map(|(n, b)| if is_redistanced && n.norm_squared() > 0.0 { *b } else { 0 })
            .collect();
        let footed = if is_redistanced { band } else { &bent };
        let number = |key: ScalarKey, known: &[u8]| {
            particles.scalar(key).iter().zip(known).map(|(v, k)| if *k == 1 { *v } else { f64::NAN }).collect()
        };
        let arrow = |key: VectorKey, known: &[u8]| -> Vec<Vector<D>> {
            let values = particles.vector(key).iter().zip(known);
            values.map(|(v, k)| if *k == 1 { *v } else { v.map(|_| f64::NAN) }).collect()
        };
        self.scalar(&PHI, || number(columns.phi, band));
        self.vector(&CLOSEST_POINT, || arrow(columns.closest_point, footed).into_iter());
        self.vector(&NORMAL, || arrow(columns.normal, &bent).into_iter());
        self.scalar(&CURVATURE, || number(columns.curvature, &bent));
    }
}
