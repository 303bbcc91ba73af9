//! The live table of a study: a row a point, columns `index`, one an axis, `job`, `state`, `reason`, `cpu_s`, `wall_s`,
//! `particles`, `steps`, `health`, then `error.QUANTITY.NORM` (at the latest time it was taken). The rows of a study that refines
//! have a `level` behind their `index`.

use crate::service::store::PointRow;
use crate::spec::health::HealthStatus;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// The table of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Names of the columns.
    pub columns: Vec<String>,
    /// A value a column.
    pub rows: Vec<Vec<Value>>,
}

/// The table of some points.
#[must_use]
pub fn compose(axes: &[String], points: &[PointRow]) -> Table {
    let kinds: BTreeSet<&String> =
        points.iter().filter_map(|point| point.errors.as_ref()).flat_map(BTreeMap::keys).collect();
    let has_levels = points.iter().any(|point| point.level.is_some());
    let mut columns = vec!["index".to_owned()];
    columns.extend(has_levels.then(|| "level".to_owned()));
    columns.extend(axes.iter().cloned());
    columns.extend(["job", "state", "reason", "cpu_s", "wall_s", "particles", "steps", "health"].map(str::to_owned));
    columns.extend(kinds.iter().map(|kind| format!("error.{kind}")));
    let rows = points.iter().map(|point| {
        let mut row = vec![json!(point.index)];
        row.extend(has_levels.then(|| json!(point.level)));
        row.extend(point.values.iter().cloned());
        row.extend([
            json!(point.job),
            json!(point.state.word()),
            json!(point.reason),
            json!(point.spent[0]),
            json!(point.spent[1]),
            json!(point.particles),
            json!(point.steps),
            json!(point.health.map(HealthStatus::word)),
        ]);
        row.extend(kinds.iter().map(|kind| json!(point.errors.as_ref().and_then(|errors| errors.get(*kind)))));
        row
    });
    Table { rows: rows.collect(), columns }
}

impl Table {
    /// As CSV (RFC 4180); what is missing is empty.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = String::new();
        let mut line = |cells: &mut dyn Iterator<Item = String>| {
            for (k, cell) in cells.enumerate() {
                let quoted = cell.contains([',', '"', '\n', '\r']);
                let cell = if quoted { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell };
                // Writing to a String cannot fail.
                let _ = write!(text, "{}{cell}", if k == 0 { "" } else { "," });
            }
            text.push('\n');
        };
        line(&mut self.columns.iter().cloned());
        for row in &self.rows {
            line(&mut row.iter().map(|value| match value {
                Value::Null => String::new(),
                Value::String(text) => text.clone(),
                other => other.to_string(),
            }));
        }
        text
    }

    /// As `{"columns", "rows": [{column: value}]}`.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let rows: Vec<Value> = self
            .rows
            .iter()
            .map(|row| Value::Object(self.columns.iter().cloned().zip(row.iter().cloned()).collect()))
            .collect();
        json!({"columns": self.columns, "rows": rows})
    }
}
