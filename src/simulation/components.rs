//! How parts of other rooms save themselves into sections and come back: particles, clocks, counts of fits.

use super::section::{Component, LoadError, Section, check_length, copy_vectors};
use crate::closest_point::FitDiagnostics;
use crate::operators::SupportDiagnostics;
use crate::particles::{ColumnValues, Particles};
use crate::time::Clock;

impl Component for Clock {
    fn save(&self, section: &mut Section) {
        section.put_count("step", self.step);
        section.put_real("time", self.time);
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        Ok(Self { step: section.count("step")?, time: section.real("time")? })
    }
}

impl Component for FitDiagnostics {
    fn save(&self, section: &mut Section) {
        for (name, count) in self.counts.entries() {
            section.put_count(name, count);
        }
        section.put_real("worst_condition", self.worst_condition);
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        let mut loaded = Self { worst_condition: section.real("worst_condition")?, ..Self::default() };
        loaded.counts.set_each(|name| section.count(name))?;
        Ok(loaded)
    }
}

impl Component for SupportDiagnostics {
    fn save(&self, section: &mut Section) {
        section.put_count("enlarged", self.enlarged);
        section.put_count("low_rank", self.low_rank);
        section.put_count("unresolved", self.unresolved);
        section.put_count("failed", self.failed);
        section.put_real("min_pivot", self.min_pivot);
    }

    /// Which point failed first is not kept: a run ends with it.
    fn load(section: &Section) -> Result<Self, LoadError> {
        Ok(Self {
            enlarged: section.count("enlarged")?,
            low_rank: section.count("low_rank")?,
            unresolved: section.count("unresolved")?,
            failed: section.count("failed")?,
            first_failed: None,
            min_pivot: section.real("min_pivot")?,
        })
    }
}

/// Saves the positions and all columns of particles.
pub fn save_particles<const D: usize>(particles: &Particles<D>, section: &mut Section) {
    section.put_vectors("position", particles.positions());
    for column in particles.columns() {
        match &column.values {
            ColumnValues::Scalar(values) => section.put_reals(column.name, values),
            ColumnValues::Vector(values) => section.put_vectors(column.name, values),
            ColumnValues::Flag(values) => section.put_flags(column.name, values),
        }
    }
}

/// Checks that every array of the particles is there with the right length.
///
/// # Errors
/// [`LoadError`].
pub fn check_particles<const D: usize>(particles: &Particles<D>, section: &Section) -> Result<(), LoadError> {
    let n = particles.len();
    section.reals_of("position", n * D)?;
    for column in particles.columns() {
        let name = column.name;
        match column.values {
            ColumnValues::Scalar(_) => check_length(name, section.reals(name)?.len(), n)?,
            ColumnValues::Vector(_) => check_length(name, section.reals(name)?.len(), n * D)?,
            ColumnValues::Flag(_) => check_length(name, section.counts(name)?.len(), n)?,
        }
    }
    Ok(())
}

/// Loads the positions and all columns into particles of the same number and columns.
///
/// # Errors
/// [`LoadError`]; the particles are unchanged then.
pub fn load_particles<const D: usize>(particles: &mut Particles<D>, section: &Section) -> Result<(), LoadError> {
    check_particles(particles, section)?;
    copy_vectors(section.reals("position")?, particles.positions_mut());
    for column in particles.columns_mut() {
        match &mut column.values {
            ColumnValues::Scalar(values) => values.copy_from_slice(section.reals(column.name)?),
            ColumnValues::Vector(values) => copy_vectors(section.reals(column.name)?, values),
            ColumnValues::Flag(values) => {
                for (flag, count) in values.iter_mut().zip(section.counts(column.name)?) {
                    *flag = u8::from(*count != 0);
                }
            }
        }
    }
    Ok(())
}
