//! Particles as a structure of arrays: positions, and named columns with one value per particle.
//!
//! A scheme adds the columns that it needs and keeps their typed keys. Checkpoints and frames go through the columns by
//! name.

use crate::geometry::Vector;

/// Positions and columns of equal length. Adding a column returns the key by which it is read and written.
///
/// ```
/// use meniscus::{geometry::Vector, particles::Particles};
///
/// let mut particles = Particles::new(vec![Vector::<2>::new(0.0, 0.0), Vector::<2>::new(1.0, 0.0)]);
/// let density = particles.add_scalar("density", 1.0);
/// particles.scalar_mut(density)[1] = 2.0;
/// assert_eq!(particles.scalar(density), [1.0, 2.0]);
/// ```
#[derive(Debug, Clone)]
pub struct Particles<const D: usize> {
    positions: Vec<Vector<D>>,
    columns: Vec<Column<D>>,
}

/// A named array with one value per particle.
#[derive(Debug, Clone, PartialEq)]
pub struct Column<const D: usize> {
    /// Name in states, checkpoints and frames.
    pub name: &'static str,
    /// One value per particle, in the order of the positions.
    pub values: ColumnValues<D>,
}

/// The values of a column, by their type.
#[derive(Debug, Clone, PartialEq)]
pub enum ColumnValues<const D: usize> {
    /// One number per particle.
    Scalar(Vec<f64>),
    /// One vector per particle.
    Vector(Vec<Vector<D>>),
    /// One small integer per particle.
    Flag(Vec<u8>),
}

/// Key of a scalar column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ScalarKey(usize);

/// Key of a vector column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VectorKey(usize);

/// Key of a flag column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FlagKey(usize);

impl<const D: usize> Particles<D> {
    /// Particles at the given positions, without columns.
    #[must_use]
    pub fn new(positions: Vec<Vector<D>>) -> Self {
        Self { positions, columns: Vec::new() }
    }

    /// Number of particles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there is no particle.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Positions of all particles.
    #[must_use]
    pub fn positions(&self) -> &[Vector<D>] {
        &self.positions
    }

    /// Positions of all particles, for moving them.
    pub fn positions_mut(&mut self) -> &mut [Vector<D>] {
        &mut self.positions
    }

    /// Adds a scalar column filled with one value.
    pub fn add_scalar(&mut self, name: &'static str, value: f64) -> ScalarKey {
        let values = ColumnValues::Scalar(vec![value; self.len()]);
        self.columns.push(Column { name, values });
        ScalarKey(self.columns.len() - 1)
    }

    /// Adds a vector column filled with one value.
    pub fn add_vector(&mut self, name: &'static str, value: Vector<D>) -> VectorKey {
        let values = ColumnValues::Vector(vec![value; self.len()]);
        self.columns.push(Column { name, values });
        VectorKey(self.columns.len() - 1)
    }

    /// Adds a flag column filled with one value.
    pub fn add_flag(&mut self, name: &'static str, value: u8) -> FlagKey {
        let values = ColumnValues::Flag(vec![value; self.len()]);
        self.columns.push(Column { name, values });
        FlagKey(self.columns.len() - 1)
    }

    /// The values of a scalar column.
    #[must_use]
    pub fn scalar(&self, key: ScalarKey) -> &[f64] {
        match &self.columns[key.0].values {
            ColumnValues::Scalar(values) => values,
            _ => &[],
        }
    }

    /// The values of a scalar column, for writing.
    pub fn scalar_mut(&mut self, key: ScalarKey) -> &mut [f64] {
        match &mut self.columns[key.0].values {
            ColumnValues::Scalar(values) => values,
            _ => &mut [],
        }
    }

    /// The values of a vector column.
    #[must_use]
    pub fn vector(&self, key: VectorKey) -> &[Vector<D>] {
        match &self.columns[key.0].values {
            ColumnValues::Vector(values) => values,
            _ => &[],
        }
    }

    /// The values of a vector column, for writing.
    pub fn vector_mut(&mut self, key: VectorKey) -> &mut [Vector<D>] {
        match &mut self.columns[key.0].values {
            ColumnValues::Vector(values) => values,
            _ => &mut [],
        }
    }

    /// The values of a flag column.
    #[must_use]
    pub fn flag(&self, key: FlagKey) -> &[u8] {
        match &self.columns[key.0].values {
            ColumnValues::Flag(values) => values,
            _ => &[],
        }
    }

    /// The values of a flag column, for writing.
    pub fn flag_mut(&mut self, key: FlagKey) -> &mut [u8] {
        match &mut self.columns[key.0].values {
            ColumnValues::Flag(values) => values,
            _ => &mut [],
        }
    }

    /// All columns, in the order in which they were added.
    #[must_use]
    pub fn columns(&self) -> &[Column<D>] {
        &self.columns
    }

    /// All columns, for restoring a state.
    pub fn columns_mut(&mut self) -> &mut [Column<D>] {
        &mut self.columns
    }
}
