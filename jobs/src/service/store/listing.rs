//! Lists of jobs: filters, order, and pages that inserts never shift.

use super::{JobRow, Store, StoreError, rows};
use crate::spec::health::HealthStatus;
use crate::spec::states::State;
use rusqlite::params_from_iter;
use rusqlite::types::Value as SqlValue;

/// Which jobs, in which order, from where on.
#[derive(Debug, Clone, Default)]
pub struct JobFilter {
    /// In one of these states.
    pub states: Vec<State>,
    /// Of this kind.
    pub kind: Option<String>,
    /// Points of this study.
    pub study: Option<String>,
    /// With this name.
    pub name: Option<String>,
    /// Made by this token.
    pub owner: Option<String>,
    /// With this health.
    pub health: Option<HealthStatus>,
    /// With all these labels.
    pub labels: Vec<(String, String)>,
    /// Made after this time.
    pub created_after: Option<String>,
    /// Made before this time.
    pub created_before: Option<String>,
    /// Oldest first instead of newest first.
    pub oldest_first: bool,
    /// At most so many.
    pub limit: u64,
    /// Id of the last job of the page before. Ids are ordered by time of making.
    pub cursor: Option<String>,
}

impl Store {
    /// A page of jobs.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn list(&self, filter: &JobFilter) -> Result<Vec<JobRow>, StoreError> {
        let mut conditions: Vec<String> = vec!["1".to_owned()];
        let mut values: Vec<SqlValue> = Vec::new();
        let mut add = |condition: &str, value: String, conditions: &mut Vec<String>| {
            values.push(SqlValue::Text(value));
            conditions.push(condition.replace('?', &format!("?{}", values.len())));
        };
        if !filter.states.is_empty() {
            // Words of a closed list, not text of a client.
            let words: Vec<String> = filter.states.iter().map(|state| format!("'{}'", state.word())).collect();
            conditions.push(format!("state IN ({})", words.join(", ")));
        }
        let plain = [
            ("kind = ?", &filter.kind),
            ("study = ?", &filter.study),
            ("name = ?", &filter.name),
            ("owner = ?", &filter.owner),
            ("created_at > ?", &filter.created_after),
            ("created_at < ?", &filter.created_before),
            (if filter.oldest_first { "id > ?" } else { "id < ?" }, &filter.cursor),
        ];
        for (condition, value) in plain {
            if let Some(value) = value {
                add(condition, value.clone(), &mut conditions);
            }
        }
        if let Some(health) = filter.health {
            conditions.push(format!("health = '{}'", health.word()));
        }
        for (key, value) in &filter.labels {
            add("EXISTS (SELECT 1 FROM json_each(jobs.labels) WHERE key = ?", key.clone(), &mut conditions);
            let open = conditions.pop().unwrap_or_default();
            add("value = ?)", value.clone(), &mut conditions);
            let close = conditions.pop().unwrap_or_default();
            conditions.push(format!("{open} AND {close}"));
        }
        let order = if filter.oldest_first { "ASC" } else { "DESC" };
        let sql =
            rows::select_jobs(&format!("{} ORDER BY id {order} LIMIT {}", conditions.join(" AND "), filter.limit));
        let connection = self.read();
        let mut statement = connection.prepare_cached(&sql)?;
        let rows = statement.query_map(params_from_iter(values), rows::job_of)?;
        Ok(rows.collect::<Result<_, _>>()?)
    }
}
