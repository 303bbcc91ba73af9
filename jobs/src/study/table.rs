//! The live table of a study: a row a point, columns `index`, one an axis, `job`, `state`, `reason`, `cpu_s`, `wall_s`,
//! `particles`, `steps`, then `error.QUANTITY.NORM` (at the latest time it was taken).

use crate::store::PointRow;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::fmt::Write;

/// A table.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Names.
    pub columns: Vec<String>,
    /// A value a column.
    pub rows: Vec<Vec<Value>>,
}

/// The errors of a finished run, by `QUANTITY.NORM`, each at its latest time.
#[must_use]
pub fn errors(point: &PointRow) -> Map<String, Value> {
    let mut found = Map::new();
    let listed = point.results.as_ref().and_then(|results| results["errors"].as_array());
    for error in listed.into_iter().flatten() {
        let word = |name: &str| error[name].as_str().unwrap_or_default().to_owned();
        // They come in the order of their times.
        found.insert(format!("{}.{}", word("quantity"), word("norm")), error["value"].clone());
    }
    found
}

/// The value of a point at an axis: as it was sent, else the default that it got.
#[must_use]
pub fn value_at(point: &PointRow, pointer: &str) -> Value {
    let sent = point.spec.pointer(pointer).filter(|value| !value.is_null());
    sent.or_else(|| point.resolved.pointer(pointer)).cloned().unwrap_or(Value::Null)
}

/// The table of some points.
#[must_use]
pub fn compose(axes: &[String], points: &[PointRow]) -> Table {
    let errors: Vec<Map<String, Value>> = points.iter().map(errors).collect();
    let kinds: BTreeSet<&String> = errors.iter().flat_map(Map::keys).collect();
    let mut columns = vec!["index".to_owned()];
    columns.extend(axes.iter().cloned());
    columns.extend(["job", "state", "reason", "cpu_s", "wall_s", "particles", "steps"].map(str::to_owned));
    columns.extend(kinds.iter().map(|kind| format!("error.{kind}")));
    let rows = points.iter().zip(&errors).map(|(point, errors)| {
        let mut row = vec![json!(point.index)];
        row.extend(axes.iter().map(|axis| value_at(point, axis)));
        row.extend([
            json!(point.job),
            json!(point.state.word()),
            json!(point.reason),
            json!(point.usage.cpu_s),
            json!(point.usage.wall_s),
            json!(point.particles),
            json!(point.steps),
        ]);
        row.extend(kinds.iter().map(|kind| errors.get(*kind).cloned().unwrap_or(Value::Null)));
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
