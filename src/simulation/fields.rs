//! What a frame shows: points in space with named values.

use crate::closest_point::SurfaceColumns;
use crate::geometry::Vector;
use crate::particles::{Particles, ScalarKey, VectorKey};

/// Points and their values at one moment. 2D points have z = 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Fields {
    /// Positions.
    pub points: Vec<[f64; 3]>,
    /// Point data.
    pub columns: Vec<Field>,
}

/// One named field.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Name as in the scene's list of fields.
    pub name: &'static str,
    /// One value a point.
    pub values: FieldValues,
}

/// The values of a field.
#[derive(Debug, Clone, PartialEq)]
pub enum FieldValues {
    /// Numbers.
    Scalar(Vec<f64>),
    /// Vectors, z = 0 in 2D.
    Vector(Vec<[f64; 3]>),
    /// Large whole numbers.
    Id(Vec<u64>),
}

/// A vector with its missing components set to zero.
#[must_use]
pub fn in_space<const D: usize>(x: &Vector<D>) -> [f64; 3] {
    std::array::from_fn(|d| if d < D { x[d] } else { 0.0 })
}

impl Fields {
    /// Points without fields.
    #[must_use]
    pub fn at<const D: usize>(points: &[Vector<D>]) -> Self {
        Self { points: points.iter().map(in_space).collect(), columns: Vec::new() }
    }

    /// Adds numbers.
    pub fn scalar(&mut self, name: &'static str, values: Vec<f64>) {
        self.columns.push(Field { name, values: FieldValues::Scalar(values) });
    }

    /// Adds vectors.
    pub fn vector<const D: usize>(&mut self, name: &'static str, values: impl Iterator<Item = Vector<D>>) {
        self.columns.push(Field { name, values: FieldValues::Vector(values.map(|v| in_space(&v)).collect()) });
    }

    /// Adds particle numbers.
    pub fn id(&mut self, name: &'static str, values: Vec<u64>) {
        self.columns.push(Field { name, values: FieldValues::Id(values) });
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
        self.scalar("phi", number(columns.phi, band));
        self.vector("closest_point", arrow(columns.closest_point, footed).into_iter());
        self.vector("normal", arrow(columns.normal, &bent).into_iter());
        self.scalar("curvature", number(columns.curvature, &bent));
    }
}
