//! The series as CSV: a header of names, then rows of numbers that read back to the last bit.

use serde_json::{Map, Value, json};

/// The header line.
#[must_use]
pub fn header(names: &[&str]) -> String {
    let mut line = names.join(",");
    line.push('\n');
    line
}

/// A row; the shortest decimal that reads back to the same double.
#[must_use]
pub fn row(values: &[f64]) -> String {
    let mut line = values.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(",");
    line.push('\n');
    line
}

/// A series as it is read back.
#[derive(Debug, Clone, PartialEq)]
pub struct Table<'a> {
    /// Names of the columns.
    pub columns: Vec<&'a str>,
    /// Rows of numbers, NaN where there is none.
    pub rows: Vec<Vec<f64>>,
}

impl<'a> Table<'a> {
    /// The table of a CSV text. An incomplete last line is left out.
    #[must_use]
    pub fn from_text(text: &'a str) -> Self {
        let whole = text.rfind('\n').map_or("", |end| &text[..end]);
        let mut lines = whole.lines();
        let columns: Vec<&str> = lines.next().map(|line| line.split(',').collect()).unwrap_or_default();
        let number = |word: &str| word.parse::<f64>().ok().filter(|v| v.is_finite()).unwrap_or(f64::NAN);
        let row = |line: &str| line.split(',').take(columns.len()).map(number).collect();
        Self { rows: lines.map(row).collect(), columns }
    }

    /// The numbers of a column, NaN where the table has none.
    pub fn column(&self, name: &str) -> impl Iterator<Item = f64> {
        let place = self.columns.iter().position(|column| *column == name);
        self.rows.iter().map(move |row| place.and_then(|k| row.get(k)).copied().unwrap_or(f64::NAN))
    }
}

/// A CSV text as `{"columns": […], "rows": [{…}]}`, null where there is no number.
#[must_use]
pub fn to_json(text: &str) -> Value {
    let table = Table::from_text(text);
    let value = |number: &f64| if number.is_finite() { json!(number) } else { Value::Null };
    let pairs = |row: &Vec<f64>| -> Map<String, Value> {
        table.columns.iter().zip(row).map(|(name, number)| ((*name).to_owned(), value(number))).collect()
    };
    let rows: Vec<Value> = table.rows.iter().map(|row| Value::Object(pairs(row))).collect();
    json!({"columns": table.columns, "rows": rows})
}

#[cfg(test)]
mod tests {
    use super::{header, row, to_json};

    #[test]
    fn numbers_survive_the_round_trip_and_torn_rows_do_not() {
        let third = 1.0 / 3.0;
        let text = header(&["time", "area"]) + &row(&[0.1, third]) + &row(&[1e-300, f64::NAN]) + "0.5,0.";
        let json = to_json(&text);
        assert_eq!(json["columns"][1], "area");
        assert_eq!(json["rows"].as_array().unwrap().len(), 2);
        assert_eq!(json["rows"][0]["area"].as_f64().unwrap().to_bits(), third.to_bits());
        assert!(json["rows"][1]["area"].is_null());
    }
}
