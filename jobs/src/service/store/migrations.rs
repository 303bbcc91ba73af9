//! Numbered changes of the schema; `user_version` counts those that have been made.

use super::StoreError;
use rusqlite::Connection;

/// The changes in order. A change that has been released is never edited.
const MIGRATIONS: &[&str] = &[
    "
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
",
    // Studies, uploads, requests carried out once, calibration; the queue in an index of its own.
    "
    ALTER TABLE jobs ADD COLUMN study TEXT;
    ALTER TABLE jobs ADD COLUMN study_index INTEGER;
    ALTER TABLE jobs ADD COLUMN superseded INTEGER NOT NULL DEFAULT 0;
    ALTER TABLE jobs ADD COLUMN retry_of TEXT;
    ALTER TABLE jobs ADD COLUMN rank REAL NOT NULL DEFAULT 0;
    ALTER TABLE jobs ADD COLUMN memory_bytes INTEGER NOT NULL DEFAULT 0;
    ALTER TABLE jobs ADD COLUMN disk_bytes INTEGER NOT NULL DEFAULT 0;
    ALTER TABLE jobs ADD COLUMN results TEXT;
    UPDATE jobs SET rank = unixepoch(created_at) - priority * 600.0,
        memory_bytes = COALESCE(json_extract(estimate, '$.memory_bytes'), 0),
        disk_bytes = COALESCE(json_extract(estimate, '$.disk_bytes'), 0);
    DROP INDEX jobs_by_queue;
    CREATE INDEX jobs_queued ON jobs (rank, id, study, memory_bytes, disk_bytes) WHERE state = 'queued';
    CREATE INDEX jobs_by_state ON jobs (state, id);
    CREATE INDEX jobs_by_study ON jobs (study, study_index, id) WHERE study IS NOT NULL;
    CREATE INDEX jobs_by_start ON jobs (restarted_from) WHERE restarted_from IS NOT NULL;
    CREATE TABLE studies (
        id TEXT PRIMARY KEY,
        name TEXT,
        labels TEXT NOT NULL,
        base TEXT NOT NULL,
        sweep TEXT NOT NULL,
        axes TEXT NOT NULL,
        points INTEGER NOT NULL,
        max_parallel INTEGER,
        on_failure TEXT NOT NULL,
        stopping INTEGER NOT NULL DEFAULT 0,
        estimate TEXT NOT NULL,
        created_at TEXT NOT NULL
    ) STRICT;
    CREATE TABLE study_events (
        study TEXT NOT NULL,
        id INTEGER NOT NULL,
        job TEXT NOT NULL,
        event INTEGER NOT NULL,
        PRIMARY KEY (study, id)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE uploads (
        id TEXT PRIMARY KEY,
        purpose TEXT NOT NULL,
        state TEXT NOT NULL,
        reason TEXT,
        found TEXT,
        name TEXT,
        size_bytes INTEGER NOT NULL,
        sha256 TEXT NOT NULL,
        created_at TEXT NOT NULL,
        checked_at TEXT
    ) STRICT;
    CREATE TABLE inputs (
        job TEXT NOT NULL,
        upload TEXT NOT NULL,
        PRIMARY KEY (job, upload)
    ) STRICT, WITHOUT ROWID;
    CREATE INDEX inputs_by_upload ON inputs (upload);
    CREATE TABLE answers (
        owner TEXT NOT NULL,
        key TEXT NOT NULL,
        request_sha256 TEXT NOT NULL,
        status INTEGER NOT NULL,
        location TEXT,
        body TEXT NOT NULL,
        created_at TEXT NOT NULL,
        PRIMARY KEY (owner, key)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE calibration (
        build TEXT NOT NULL,
        machine TEXT NOT NULL,
        kind TEXT NOT NULL,
        phase TEXT NOT NULL,
        work REAL NOT NULL,
        seconds REAL NOT NULL,
        PRIMARY KEY (build, machine, kind, phase)
    ) STRICT, WITHOUT ROWID;
",
    // What clients were told is opaque to the store; a worker is known by the handle that its executor gave.
    "
    CREATE TABLE receipts (
        owner TEXT NOT NULL,
        key TEXT NOT NULL,
        fingerprint TEXT NOT NULL,
        receipt BLOB NOT NULL,
        created_at TEXT NOT NULL,
        PRIMARY KEY (owner, key)
    ) STRICT, WITHOUT ROWID;
    INSERT INTO receipts (owner, key, fingerprint, receipt, created_at)
        SELECT owner, key, request_sha256,
            CAST(json_object('status', status, 'location', location, 'body', body) AS BLOB), created_at
        FROM answers;
    DROP TABLE answers;
    ALTER TABLE jobs ADD COLUMN worker_handle TEXT;
    UPDATE jobs SET worker_handle = CAST(worker_pid AS TEXT) WHERE worker_pid IS NOT NULL;
    ALTER TABLE jobs DROP COLUMN worker_pid;
    ALTER TABLE jobs RENAME COLUMN condemned TO kill_reason;
",
    "
    ALTER TABLE jobs ADD COLUMN findings TEXT NOT NULL DEFAULT '[]';
    ALTER TABLE jobs ADD COLUMN health TEXT;
    CREATE INDEX jobs_by_health ON jobs (health, id) WHERE health = 'doubtful';
",
    // A clock that does not depend on the time of day; folders that are being deleted; owners; jobs that wait for others.
    "
    CREATE TABLE service_clock (
        id INTEGER PRIMARY KEY CHECK (id = 1),
        seconds REAL NOT NULL,
        wall_ms INTEGER NOT NULL
    ) STRICT;
    INSERT INTO service_clock (id, seconds, wall_ms)
        VALUES (1, (SELECT COALESCE(MAX(rank + priority * 600.0), 0.0) FROM jobs), unixepoch() * 1000);
    ALTER TABLE jobs ADD COLUMN ended_s REAL;
    UPDATE jobs SET ended_s = (SELECT seconds FROM service_clock)
        WHERE state IN ('succeeded', 'failed', 'canceled');
    CREATE INDEX jobs_by_end ON jobs (ended_s) WHERE ended_s IS NOT NULL;
    ALTER TABLE studies ADD COLUMN made_s REAL NOT NULL DEFAULT 0;
    UPDATE studies SET made_s = (SELECT seconds FROM service_clock);
    ALTER TABLE receipts ADD COLUMN made_s REAL NOT NULL DEFAULT 0;
    UPDATE receipts SET made_s = (SELECT seconds FROM service_clock);
    CREATE TABLE deletions (folder TEXT PRIMARY KEY) STRICT, WITHOUT ROWID;
    ALTER TABLE jobs ADD COLUMN owner TEXT;
    ALTER TABLE studies ADD COLUMN owner TEXT;
    ALTER TABLE uploads ADD COLUMN owner TEXT;
    CREATE INDEX jobs_by_owner ON jobs (owner, id) WHERE owner IS NOT NULL;
    ALTER TABLE jobs ADD COLUMN predecessors TEXT NOT NULL DEFAULT '[]';
    ALTER TABLE jobs ADD COLUMN restart_job TEXT;
    CREATE TABLE dependencies (
        job TEXT NOT NULL,
        predecessor TEXT NOT NULL,
        PRIMARY KEY (job, predecessor)
    ) STRICT, WITHOUT ROWID;
    CREATE INDEX dependencies_by_predecessor ON dependencies (predecessor);
",
    // Studies that refine, and the digest by which equal jobs are found.
    "
    CREATE TABLE refinements (
        study TEXT PRIMARY KEY,
        state TEXT NOT NULL,
        outcome TEXT,
        message TEXT,
        chosen INTEGER,
        threads INTEGER NOT NULL,
        memory_bytes INTEGER NOT NULL,
        most_levels INTEGER NOT NULL,
        job TEXT
    ) STRICT, WITHOUT ROWID;
    CREATE INDEX refinements_open ON refinements (study) WHERE state = 'open';
    CREATE INDEX refinements_serving ON refinements (study) WHERE job IS NOT NULL AND state <> 'ended';
    CREATE TABLE levels (
        study TEXT NOT NULL,
        number INTEGER NOT NULL,
        setup INTEGER NOT NULL,
        level INTEGER NOT NULL,
        job TEXT,
        is_reused INTEGER NOT NULL,
        is_to_repeat INTEGER NOT NULL,
        measured TEXT,
        PRIMARY KEY (study, number)
    ) STRICT, WITHOUT ROWID;
    ALTER TABLE jobs ADD COLUMN scene_sha256 TEXT;
    ALTER TABLE jobs ADD COLUMN awaits TEXT;
    ALTER TABLE jobs ADD COLUMN problem TEXT;
    ALTER TABLE jobs ADD COLUMN spacing REAL;
    CREATE TABLE work_precision (
        build TEXT NOT NULL,
        isa TEXT NOT NULL,
        problem TEXT NOT NULL,
        quantity TEXT NOT NULL,
        norm TEXT NOT NULL,
        spacing REAL NOT NULL,
        error REAL NOT NULL,
        cpu_s REAL NOT NULL,
        PRIMARY KEY (build, isa, problem, quantity, norm, spacing)
    ) STRICT, WITHOUT ROWID;
    CREATE INDEX jobs_by_scene ON jobs (scene_sha256, id) WHERE scene_sha256 IS NOT NULL;
",
    // Executors with queues of their own.
    "
    ALTER TABLE jobs ADD COLUMN waiting_for TEXT;
    ALTER TABLE jobs ADD COLUMN evictions INTEGER NOT NULL DEFAULT 0;
",
];

/// Number of schema changes that this program knows.
#[must_use]
pub fn known() -> i64 {
    MIGRATIONS.len() as i64
}

/// Makes the changes that are missing, each in a transaction of its own.
///
/// # Errors
/// [`StoreError`]; a store of a later version is refused.
pub fn apply(connection: &mut Connection) -> Result<(), StoreError> {
    let found: i64 = connection.pragma_query_value(None, "user_version", |row| row.get(0))?;
    let known = known();
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

#[cfg(test)]
mod tests {
    use super::{MIGRATIONS, apply};
    use rusqlite::Connection;

    #[test]
    fn a_store_of_the_build_before_keeps_its_answers_and_its_workers() {
        let mut connection = Connection::open_in_memory().unwrap();
        for change in &MIGRATIONS[..2] {
            connection.execute_batch(change).unwrap();
        }
        connection
            .execute_batch(
                "PRAGMA user_version = 2;
                 INSERT INTO answers VALUES ('owner', 'key', 'digest', 201, '/v1/jobs/job_1', '{\"id\":\"job_1\"}', 'now');
                 INSERT INTO jobs (id, rev, state, labels, kind, spec, resolved, estimate, priority, created_at, worker_pid,
                     condemned)
                 VALUES ('job_1', 1, 'running', '{}', 'vortex', '{}', '{}', '{}', 0, 'now', 4711, 'limit.memory');",
            )
            .unwrap();
        apply(&mut connection).unwrap();
        let receipt: Vec<u8> =
            connection.query_row("SELECT receipt FROM receipts WHERE key = 'key'", [], |row| row.get(0)).unwrap();
        let expected = r#"{"status":201,"location":"/v1/jobs/job_1","body":"{\"id\":\"job_1\"}"}"#;
        assert_eq!(String::from_utf8(receipt).unwrap(), expected);
        let worker: (String, String) = connection
            .query_row("SELECT worker_handle, kill_reason FROM jobs", [], |row| Ok((row.get(0)?, row.get(1)?)))
            .unwrap();
        assert_eq!(worker, ("4711".to_owned(), "limit.memory".to_owned()));
    }
}
