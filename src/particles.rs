//! All per-particle arrays of a simulation: positions and named columns, each an array of its own.

use crate::geometry::Vector;

/// Positions and columns of equal length. A column is reached by the key that adding it returned.
#[derive(Debug, Clone)]
pub struct Particles<const D: usize> {
    positions: Vec<Vector<D>>,
    columns: Vec<Column<D>>,
}

/// A named per-particle array.
#[derive(Debug, Clone, PartialEq)]
pub struct Column<const D: usize> {
    /// Name as it stands in states, checkpoints and frames.
    pub name: &'static str,
    /// The values.
    pub values: ColumnValues<D>,
}

/// The values of a column, by kind.
#[derive(Debug, Clone, PartialEq)]
pub enum ColumnValues<const D: usize> {
    /// One number a particle.
    Scalar(Vec<f64>),
    /// One vector a particle.
    Vector(Vec<Vector<D>>),
    /// One small whole number a particle.
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
    /// Particles at the given places, without columns.
    #[must_use]
    pub fn new(positions: Vec<Vector<D>>) -> Self {
        Self { positions, columns: Vec::new() }
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Where they are.
    #[must_use]
    pub fn positions(&self) -> &[Vector<D>] {
        &self.positions
    }

    /// Where they are, to move them.
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

    /// A scalar column.
    #[must_use]
    pub fn scalar(&self, key: ScalarKey) -> &[f64] {
        match &self.columns[key.0].values {
            ColumnValues::Scalar(values) => values,
            _ => &[],
        }
    }

    /// A scalar column, to write.
    pub fn scalar_mut(&mut self, key: ScalarKey) -> &mut [f64] {
        match &mut self.columns[key.0].values {
            ColumnValues::Scalar(values) => values,
            _ => &mut [],
        }
    }

    /// A vector column.
    #[must_use]
    pub fn vector(&self, key: VectorKey) -> &[Vector<D>] {
        match &self.columns[key.0].values {
            ColumnValues::Vector(values) => values,
            _ => &[],
        }
    }

    /// A vector column, to write.
    pub fn vector_mut(&mut self, key: VectorKey) -> &mut [Vector<D>] {
        match &mut self.columns[key.0].values {
            ColumnValues::Vector(values) => values,
            _ => &mut [],
        }
    }

    /// A flag column.
    #[must_use]
    pub fn flag(&self, key: FlagKey) -> &[u8] {
        match &self.columns[key.0].values {
            ColumnValues::Flag(values) => values,
            _ => &[],
        }
    }

    /// A flag column, to write.
    pub fn flag_mut(&mut self, key: FlagKey) -> &mut [u8] {
        match &mut self.columns[key.0].values {
            ColumnValues::Flag(values) => values,
            _ => &mut [],
        }
    }

    /// Every column in the order of adding.
    #[must_use]
    pub fn columns(&self) -> &[Column<D>] {
        &self.columns
    }

    /// Every column, to write (restoring a state).
    pub fn columns_mut(&mut self) -> &mut [Column<D>] {
        &mut self.columns
    }
}
