//! Numbered changes of the schema; `user_version` says how many have been made.

use super::StoreError;
use rusqlite::Connection;

/// The changes in order. A change that has been released is never edited.
const MIGRATIONS: &[&str] = &["
    CREATE TABLE jobs (
        id TEXT PRIMARY KEY,
        rev INTEGER NOT NULL,
        state TEXT NOT NULL,
        reason TEXT,
        hint TEXT,
        name TEXT,
        labels TEXT NOT NULL,
        kind TEXT NOT NULL,
        spec TEXT NOT NULL,
        resolved TEXT NOT NULL,
        estimate TEXT NOT NULL,
        priority INTEGER NOT NULL,
        created_at TEXT NOT NULL,
        started_at TEXT,
        finished_at TEXT,
        attempt INTEGER NOT NULL DEFAULT 0,
        deaths INTEGER NOT NULL DEFAULT 0,
        records_offset INTEGER NOT NULL DEFAULT 0,
        checkpoint_since INTEGER NOT NULL DEFAULT 0,
        worker_pid INTEGER,
        verdict TEXT,
        condemned TEXT,
        lease_until TEXT,
        progress TEXT,
        progress_count INTEGER NOT NULL DEFAULT 0,
        warnings TEXT NOT NULL DEFAULT '[]',
        usage TEXT,
        leg_wall_s REAL NOT NULL DEFAULT 0,
        message TEXT,
        restarted_from TEXT,
        restart_sha256 TEXT
    ) STRICT;
    CREATE INDEX jobs_by_queue ON jobs (state, priority DESC, id);
    CREATE TABLE events (
        job TEXT NOT NULL,
        id INTEGER NOT NULL,
        type TEXT NOT NULL,
        at TEXT NOT NULL,
        attempt INTEGER NOT NULL,
        data TEXT NOT NULL,
        PRIMARY KEY (job, id)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE files (
        job TEXT NOT NULL,
        path TEXT NOT NULL,
        attempt INTEGER NOT NULL,
        size_bytes INTEGER NOT NULL,
        sha256 TEXT NOT NULL,
        media_type TEXT NOT NULL,
        time REAL,
        step INTEGER,
        PRIMARY KEY (job, path)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE checkpoints (
        id TEXT PRIMARY KEY,
        job TEXT NOT NULL,
        attempt INTEGER NOT NULL,
        path TEXT NOT NULL,
        step INTEGER NOT NULL,
        time REAL NOT NULL,
        size_bytes INTEGER NOT NULL,
        sha256 TEXT NOT NULL,
        created_at TEXT NOT NULL,
        isa TEXT NOT NULL,
        build TEXT NOT NULL
    ) STRICT;
    CREATE INDEX checkpoints_by_job ON checkpoints (job, id);
"];

/// Makes the changes that are missing, each in a transaction of its own.
///
/// # Errors
/// [`StoreError`]; a store of a later version is refused.
pub fn apply(connection: &mut Connection) -> Result<(), StoreError> {
    let found: i64 = connection.pragma_query_value(None, "user_version", |row| row.get(0))?;
    let known = MIGRATIONS.len() as i64;
    if found > known {
        return Err(StoreError::Newer { found, known });
    }
    for (number, change) in MIGRATIONS.iter().enumerate().skip(found as usize) {
        let transaction = connection.transaction()?;
        transaction.execute_batch(change)?;
        transaction.pragma_update(None, "user_version", number as i64 + 1)?;
        transaction.commit()?;
    }
    Ok(())
}
