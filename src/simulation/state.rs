//! The state of a simulation as named arrays: what a checkpoint holds.

use crate::geometry::Vector;
use crate::particles::{ColumnValues, Particles};

/// Everything that the future of a simulation depends on, beside its scene.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct State {
    /// Steps done.
    pub step: u64,
    /// Scene time.
    pub time: f64,
    /// Arrays of doubles.
    pub reals: Vec<RealArray>,
    /// Arrays of whole numbers.
    pub counts: Vec<CountArray>,
}

/// A named array of doubles, `values.len()` a multiple of `components`.
#[derive(Debug, Clone, PartialEq)]
pub struct RealArray {
    /// Name.
    pub name: String,
    /// Numbers per entry.
    pub components: usize,
    /// The numbers, entry by entry.
    pub values: Vec<f64>,
}

/// A named array of whole numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CountArray {
    /// Name.
    pub name: String,
    /// The numbers.
    pub values: Vec<u64>,
}

/// A state does not belong to the simulation.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RestoreError {
    /// An array is missing.
    #[error("the state has no array {name}")]
    Missing {
        /// Which.
        name: String,
    },
    /// An array has another shape.
    #[error("array {name} has {got} numbers, this scene needs {expected}")]
    Length {
        /// Which.
        name: String,
        /// Its length.
        got: usize,
        /// The length needed.
        expected: usize,
    },
    /// The step number lies beyond the end of the run.
    #[error("the state is at step {step}, the run ends at step {last}")]
    Beyond {
        /// Of the state.
        step: u64,
        /// Of the run.
        last: u64,
    },
}

impl State {
    /// Adds the positions and all columns of particles.
    pub fn push_particles<const D: usize>(&mut self, particles: &Particles<D>) {
        self.push_vectors("position", particles.positions());
        for column in particles.columns() {
            match &column.values {
                ColumnValues::Scalar(values) => self.push_reals(column.name, values),
                ColumnValues::Vector(values) => self.push_vectors(column.name, values),
                ColumnValues::Flag(values) => {
                    self.push_counts(column.name, values.iter().map(|&f| u64::from(f)).collect());
                }
            }
        }
    }

    /// Adds scalars.
    pub fn push_reals(&mut self, name: &str, values: &[f64]) {
        self.reals.push(RealArray { name: name.to_owned(), components: 1, values: values.to_vec() });
    }

    /// Adds vectors.
    pub fn push_vectors<const D: usize>(&mut self, name: &str, values: &[Vector<D>]) {
        let values = values.iter().flat_map(|v| v.iter().copied()).collect();
        self.reals.push(RealArray { name: name.to_owned(), components: D, values });
    }

    /// Adds whole numbers.
    pub fn push_counts(&mut self, name: &str, values: Vec<u64>) {
        self.counts.push(CountArray { name: name.to_owned(), values });
    }

    /// An array of doubles by name.
    ///
    /// # Errors
    /// [`RestoreError::Missing`].
    pub fn reals(&self, name: &str) -> Result<&[f64], RestoreError> {
        let found = self.reals.iter().find(|array| array.name == name);
        found.map(|array| array.values.as_slice()).ok_or_else(|| RestoreError::Missing { name: name.to_owned() })
    }

    /// An array of whole numbers by name.
    ///
    /// # Errors
    /// [`RestoreError::Missing`].
    pub fn counts(&self, name: &str) -> Result<&[u64], RestoreError> {
        let found = self.counts.iter().find(|array| array.name == name);
        found.map(|array| array.values.as_slice()).ok_or_else(|| RestoreError::Missing { name: name.to_owned() })
    }

    /// Checks that every array of the particles is there with the right length.
    ///
    /// # Errors
    /// [`RestoreError`].
    pub fn check_particles<const D: usize>(&self, particles: &Particles<D>) -> Result<(), RestoreError> {
        let n = particles.len();
        check_length("position", self.reals("position")?.len(), n * D)?;
        for column in particles.columns() {
            match column.values {
                ColumnValues::Scalar(_) => check_length(column.name, self.reals(column.name)?.len(), n)?,
                ColumnValues::Vector(_) => check_length(column.name, self.reals(column.name)?.len(), n * D)?,
                ColumnValues::Flag(_) => check_length(column.name, self.counts(column.name)?.len(), n)?,
            }
        }
        Ok(())
    }

    /// Writes the arrays into particles of the same number and columns.
    ///
    /// # Errors
    /// [`RestoreError`]; the particles are unchanged then.
    pub fn pull_particles<const D: usize>(&self, particles: &mut Particles<D>) -> Result<(), RestoreError> {
        self.check_particles(particles)?;
        copy_vectors(self.reals("position")?, particles.positions_mut());
        for column in particles.columns_mut() {
            match &mut column.values {
                ColumnValues::Scalar(values) => values.copy_from_slice(self.reals(column.name)?),
                ColumnValues::Vector(values) => copy_vectors(self.reals(column.name)?, values),
                ColumnValues::Flag(values) => {
                    for (flag, count) in values.iter_mut().zip(self.counts(column.name)?) {
                        *flag = u8::from(*count != 0);
                    }
                }
            }
        }
        Ok(())
    }
}

/// An error unless the lengths agree.
///
/// # Errors
/// [`RestoreError::Length`].
pub fn check_length(name: &str, got: usize, expected: usize) -> Result<(), RestoreError> {
    if got == expected { Ok(()) } else { Err(RestoreError::Length { name: name.to_owned(), got, expected }) }
}

fn copy_vectors<const D: usize>(from: &[f64], to: &mut [Vector<D>]) {
    for (vector, numbers) in to.iter_mut().zip(from.chunks_exact(D)) {
        vector.as_mut_slice().copy_from_slice(numbers);
    }
}
