//! What was measured on this machine with this build.

use super::{Store, StoreError};
use crate::spec::calibration::{Calibration, MEMORY, Measured, PhaseMeasured, machine};
use crate::system::build;
use rusqlite::{Connection, Transaction, params};

impl Store {
    /// Everything that was measured on this machine with this build.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn calibration(&self) -> Result<Calibration, StoreError> {
        Ok(read(&self.read())?)
    }

    /// Adds the measurements of finished runs.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn calibrate(&self, found: &[PhaseMeasured]) -> Result<(), StoreError> {
        self.write(|transaction| Ok(add(transaction, found)?))
    }
}

fn read(connection: &Connection) -> rusqlite::Result<Calibration> {
    let mut statement = connection
        .prepare_cached("SELECT kind, phase, work, seconds FROM calibration WHERE build = ?1 AND machine = ?2")?;
    let rows = statement.query_map(params![build::name(), machine()], |row| {
        Ok(PhaseMeasured {
            family: row.get(0)?,
            phase: row.get(1)?,
            measured: Measured { work: row.get(2)?, seconds: row.get(3)? },
        })
    })?;
    Ok(Calibration::new(rows.collect::<Result<Vec<_>, _>>()?))
}

/// New runs weigh more than old ones, long ones more than short ones.
pub(super) fn add(transaction: &Transaction, found: &[PhaseMeasured]) -> rusqlite::Result<()> {
    let mut statement = transaction.prepare_cached(
        "INSERT INTO calibration (build, machine, kind, phase, work, seconds) VALUES (?1, ?2, ?3, ?4, ?5, ?6)
         ON CONFLICT (build, machine, kind, phase)
         DO UPDATE SET work = work * ?7 + excluded.work, seconds = seconds * ?7 + excluded.seconds",
    )?;
    for PhaseMeasured { family, phase, measured } in found {
        let values = params![build::name(), machine(), family, phase, measured.work, measured.seconds, MEMORY];
        statement.execute(values)?;
    }
    Ok(())
}
