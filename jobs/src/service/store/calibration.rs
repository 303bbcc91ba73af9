//! What was measured with this build on this machine, or on the nodes of the cluster that runs the jobs.

use super::{Store, StoreError};
use crate::spec::calibration::{Calibration, MEMORY, Measured, PhaseMeasured, machine};
use crate::system::build;
use rusqlite::{Connection, OptionalExtension, Transaction, params};

impl Store {
    /// Everything that was measured on this machine with this build.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn calibration(&self) -> Result<Calibration, StoreError> {
        let connection = self.read();
        let node = if self.is_on_cluster() { usual_node(&connection)? } else { None };
        Ok(read(&connection, node.as_deref().unwrap_or(machine()))?)
    }

    /// The machine that a run of this service is booked to.
    pub(super) fn machine_of(&self, cpu: &str) -> String {
        if self.is_on_cluster() { format!("{NODE}{cpu}") } else { machine().to_owned() }
    }

    /// Adds the measurements of finished runs.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn calibrate(&self, found: &[PhaseMeasured]) -> Result<(), StoreError> {
        self.write(|transaction| Ok(add(transaction, machine(), found)?))
    }
}

/// Start of the names of nodes; the name of their processor follows.
const NODE: &str = "node: ";

/// The kind of node that has computed most.
fn usual_node(connection: &Connection) -> rusqlite::Result<Option<String>> {
    connection
        .prepare_cached(
            "SELECT machine FROM calibration WHERE build = ?1 AND machine LIKE ?2 || '%'
             GROUP BY machine ORDER BY SUM(seconds) DESC LIMIT 1",
        )?
        .query_row([&build::name(), NODE], |row| row.get(0))
        .optional()
}

fn read(connection: &Connection, machine: &str) -> rusqlite::Result<Calibration> {
    let mut statement = connection
        .prepare_cached("SELECT kind, phase, work, seconds FROM calibration WHERE build = ?1 AND machine = ?2")?;
    let rows = statement.query_map(params![build::name(), machine], |row| {
        Ok(PhaseMeasured {
            family: row.get(0)?,
            phase: row.get(1)?,
            measured: Measured { work: row.get(2)?, seconds: row.get(3)? },
        })
    })?;
    Ok(Calibration::new(rows.collect::<Result<Vec<_>, _>>()?))
}

/// New runs weigh more than old ones, long ones more than short ones.
pub(super) fn add(transaction: &Transaction, machine: &str, found: &[PhaseMeasured]) -> rusqlite::Result<()> {
    let mut statement = transaction.prepare_cached(
        "INSERT INTO calibration (build, machine, kind, phase, work, seconds) VALUES (?1, ?2, ?3, ?4, ?5, ?6)
         ON CONFLICT (build, machine, kind, phase)
         DO UPDATE SET work = work * ?7 + excluded.work, seconds = seconds * ?7 + excluded.seconds",
    )?;
    for PhaseMeasured { family, phase, measured } in found {
        let values = params![build::name(), machine, family, phase, measured.work, measured.seconds, MEMORY];
        statement.execute(values)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::service::store::{Store, StoreError};
    use crate::spec::calibration::{Measured, PhaseMeasured};
    use std::sync::Arc;

    #[test]
    fn estimates_on_a_cluster_are_those_of_its_nodes() {
        let directory = tempfile::tempdir().unwrap();
        let store = Store::open(directory.path()).unwrap();
        let phase = |seconds| PhaseMeasured {
            family: "redistance/2".to_owned(),
            phase: "fits".to_owned(),
            measured: Measured { work: 1.0, seconds },
        };
        let seconds = |store: &Store| store.calibration().unwrap().seconds_per_unit("redistance/2", "fits");
        store.calibrate(&[phase(5.0)]).unwrap();
        store.spare_orphans(Arc::new(|_, _| false));
        // Nothing is known of the nodes yet.
        assert_eq!(seconds(&store), Some(5.0));
        let keep = |cpu: &str, found| {
            let machine = store.machine_of(cpu);
            let added: Result<(), StoreError> =
                store.write(|transaction| Ok(super::add(transaction, &machine, &[phase(found)])?));
            added.unwrap();
        };
        keep("a slow one", 2.0);
        keep("a fast one", 1.0);
        assert_eq!(seconds(&store), Some(2.0));
        store.close();
    }
}
