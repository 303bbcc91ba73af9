//! What runs of this build said of errors and their cost.

use super::{Store, StoreError};
use crate::convergence::Level;
use crate::spec::work_precision::{PrecisionMeasured, REFERENCE};
use crate::system::build;
use rusqlite::{Transaction, params};

impl Store {
    /// Keeps what runs of this build said.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn keep_precision(&self, found: &[PrecisionMeasured]) -> Result<(), StoreError> {
        self.write(|transaction| Ok(keep(transaction, found)?))
    }

    /// Whether the short runs of this build and instruction set were made.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn has_short_runs(&self) -> Result<bool, StoreError> {
        let connection = self.read();
        let mut statement = connection.prepare_cached(
            "SELECT EXISTS (SELECT 1 FROM work_precision
                 WHERE build = ?1 AND isa = ?2 AND substr(problem, 1, length(?3)) = ?3)",
        )?;
        Ok(statement.query_row(params![build::name(), build::isa(), REFERENCE], |row| row.get(0))?)
    }

    /// What runs of this build and instruction set said of an error of a problem, the coarsest first.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn precision(&self, problem: &str, quantity: &str, norm: &str) -> Result<Vec<Level>, StoreError> {
        let connection = self.read();
        let mut statement = connection.prepare_cached(
            "SELECT spacing, error, cpu_s FROM work_precision
             WHERE build = ?1 AND isa = ?2 AND problem = ?3 AND quantity = ?4 AND norm = ?5 ORDER BY spacing DESC",
        )?;
        let rows = statement.query_map(params![build::name(), build::isa(), problem, quantity, norm], |row| {
            Ok(Level { spacing: row.get(0)?, value: row.get(1)?, cpu_s: row.get(2)? })
        })?;
        Ok(rows.collect::<Result<_, _>>()?)
    }
}

/// The latest run with a spacing counts: all with the same one have the same error.
pub(super) fn keep(transaction: &Transaction, found: &[PrecisionMeasured]) -> rusqlite::Result<()> {
    let mut statement = transaction.prepare_cached(
        "INSERT OR REPLACE INTO work_precision (build, isa, problem, quantity, norm, spacing, error, cpu_s)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
    )?;
    for PrecisionMeasured { problem, quantity, norm, spacing, error, cpu_s } in found {
        statement.execute(params![build::name(), build::isa(), problem, quantity, norm, spacing, error, cpu_s])?;
    }
    Ok(())
}
