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

/// A whole CSV text as `{"columns": […], "rows": [{…}]}`. A torn last line is left out.
#[must_use]
pub fn to_json(text: &str) -> Value {
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    let mut lines = whole.lines();
    let columns: Vec<&str> = lines.next().map(|line| line.split(',').collect()).unwrap_or_default();
    let rows: Vec<Value> = lines
        .map(|line| {
            let pairs = columns.iter().zip(line.split(',')).map(|(name, number)| {
                let value = number.parse::<f64>().ok().filter(|v| v.is_finite()).map_or(Value::Null, |v| json!(v));
                ((*name).to_owned(), value)
            });
            Value::Object(pairs.collect::<Map<_, _>>())
        })
        .collect();
    json!({"columns": columns, "rows": rows})
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
