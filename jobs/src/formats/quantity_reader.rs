//! Reads the number that a study or an accuracy is about from the report and the series of a run.

use super::csv;
use crate::spec::quantity::{Quantity, SeriesNumber};
use crate::spec::report::RunReport;
use serde_json::Value;
use std::collections::BTreeSet;

/// Report and series of a finished run.
#[derive(Debug, Clone, Copy)]
pub struct RunResults<'a> {
    /// The report.
    pub report: &'a RunReport,
    /// The report as JSON.
    pub report_json: &'a Value,
    /// The series as CSV.
    pub series: &'a str,
}

/// The number.
///
/// # Errors
/// A sentence that says what the run lacks, and what it has.
pub fn read(quantity: &Quantity, results: &RunResults) -> Result<f64, String> {
    let found = match quantity {
        Quantity::Error { quantity, norm, time } => error(results.report, quantity, norm, *time)?,
        Quantity::Series { name, of, time } => of_series(results.series, name, *of, *time)?,
        Quantity::Report { pointer } => {
            // The pointer is the client's.
            let found = Value::pointer(results.report_json, pointer);
            found.and_then(Value::as_f64).ok_or_else(|| format!("the report has no number at {pointer}"))?
        }
    };
    if found.is_finite() { Ok(found) } else { Err(format!("{} is no finite number", quantity.label())) }
}

/// Size of the exact answer that an error is compared with: 1 where errors are shares already, else the mean that the report has of
/// the same quantity.
///
/// # Errors
/// A sentence where there is none.
pub fn scale(quantity: &Quantity, report: &RunReport) -> Result<f64, String> {
    match quantity {
        Quantity::Error { quantity: name, .. } if !quantity.is_share() => {
            let has_mean = quantity.has_size();
            let mean =
                report.error(name, "mean", None).map(|entry| entry.value.abs()).filter(|size| has_mean && *size > 0.0);
            mean.ok_or_else(|| {
                format!(
                    "the report has no mean of {name} by which its error could be divided; give an absolute tolerance"
                )
            })
        }
        _ => Ok(1.0),
    }
}

fn error(report: &RunReport, quantity: &str, norm: &str, time: Option<f64>) -> Result<f64, String> {
    report.error(quantity, norm, time).map(|entry| entry.value).ok_or_else(|| {
        let known: BTreeSet<String> =
            report.errors.iter().map(|entry| format!("{}.{}", entry.quantity, entry.norm)).collect();
        let known = known.into_iter().collect::<Vec<_>>().join(", ");
        let at = time.map(|time| format!(" at time {time}")).unwrap_or_default();
        format!("the report has no error {quantity}.{norm}{at}; it has {known}")
    })
}

fn of_series(text: &str, name: &str, of: SeriesNumber, time: Option<f64>) -> Result<f64, String> {
    let table = csv::Table::from_text(text);
    if !table.columns.contains(&name) {
        return Err(format!("the series has no column {name}; it has {}", table.columns.join(", ")));
    }
    let all: Vec<(f64, f64)> =
        table.column("time").zip(table.column(name)).filter(|(t, v)| t.is_finite() && v.is_finite()).collect();
    // The rows of two attempts never repeat a time.
    let rows = Rows(&all);
    let from = time.unwrap_or(f64::NEG_INFINITY);
    let found = match of {
        SeriesNumber::At => rows.at(time),
        SeriesNumber::Mean => rows.mean(from),
        SeriesNumber::Max => rows.largest(from, 1.0),
        SeriesNumber::Min => rows.largest(from, -1.0),
        SeriesNumber::Zero => rows.zero(from),
    };
    let since = time.map_or(String::new(), |time| format!(" from time {time} on"));
    found.ok_or_else(|| match of {
        SeriesNumber::At => format!("the series ends before time {}", time.unwrap_or_default()),
        SeriesNumber::Zero => format!("{name} does not pass zero{since}"),
        _ => format!("the series has no rows of {name}{since}"),
    })
}

/// Times and values, in the order of times.
struct Rows<'a>(&'a [(f64, f64)]);

impl Rows<'_> {
    fn from(&self, time: f64) -> usize {
        self.0.partition_point(|(t, _)| *t < time)
    }

    /// The value at a time; at the end where none is given.
    fn at(&self, time: Option<f64>) -> Option<f64> {
        let (first, last) = (self.0.first()?, self.0.last()?);
        let Some(time) = time else { return Some(last.1) };
        let slack = 1e-9 * (last.0 - first.0).abs();
        if time > last.0 + slack || time < first.0 - slack {
            return None;
        }
        Some(self.cubic(self.from(time), time))
    }

    /// The polynomial through the four rows about row k, at a time.
    fn cubic(&self, k: usize, time: f64) -> f64 {
        let start = k.saturating_sub(2).min(self.0.len().saturating_sub(4));
        let rows = &self.0[start..(start + 4).min(self.0.len())];
        let term = |(i, (t, v)): (usize, &(f64, f64))| {
            let others = rows.iter().enumerate().filter(|(j, _)| *j != i);
            v * others.map(|(_, (other, _))| (time - other) / (t - other)).product::<f64>()
        };
        rows.iter().enumerate().map(term).sum()
    }

    /// The mean over time by trapezoids; the one value of a single row.
    fn mean(&self, from: f64) -> Option<f64> {
        let rows = &self.0[self.from(from)..];
        let (first, last) = (rows.first()?, rows.last()?);
        if last.0 <= first.0 {
            return Some(last.1);
        }
        let area: f64 = rows.windows(2).map(|pair| 0.5 * (pair[1].0 - pair[0].0) * (pair[0].1 + pair[1].1)).sum();
        Some(area / (last.0 - first.0))
    }

    /// The largest of `sign` times the value, times `sign`: at the vertex of the parabola through the row and its neighbors.
    fn largest(&self, from: f64, sign: f64) -> Option<f64> {
        let rows = &self.0[self.from(from)..];
        let k = (0..rows.len()).max_by(|a, b| (sign * rows[*a].1).total_cmp(&(sign * rows[*b].1)))?;
        if k == 0 || k + 1 == rows.len() {
            return Some(rows[k].1);
        }
        let [(t0, v0), (t1, v1), (t2, v2)] = [rows[k - 1], rows[k], rows[k + 1]];
        let (left, right) = ((v1 - v0) / (t1 - t0), (v2 - v1) / (t2 - t1));
        let bend = (right - left) / (t2 - t0);
        let slope = (left * (t2 - t1) + right * (t1 - t0)) / (t2 - t0);
        let found = v1 - slope * slope / (4.0 * bend);
        Some(if found.is_finite() && bend != 0.0 { found } else { v1 })
    }

    /// The first time after `from` at which the value passes zero.
    fn zero(&self, from: f64) -> Option<f64> {
        let first = self.from(from).max(1);
        let k = (first..self.0.len()).find(|k| {
            let (before, after) = (self.0[k - 1], self.0[*k]);
            before.0 >= from && (before.1 > 0.0) != (after.1 > 0.0)
        })?;
        let ((mut low, at_low), (mut high, _)) = (self.0[k - 1], self.0[k]);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if (self.cubic(k, middle) > 0.0) == (at_low > 0.0) { low = middle } else { high = middle }
        }
        Some(0.5 * (low + high))
    }
}

#[cfg(test)]
mod tests {
    use super::{SeriesNumber, of_series};
    use crate::formats::csv;

    /// cos 3t on rows a tenth apart.
    fn cosine() -> String {
        let rows = (0..=40).map(|k| 0.1 * f64::from(k)).map(|t| csv::row(&[t, (3.0 * t).cos()]));
        csv::header(&["time", "x"]) + &rows.collect::<String>()
    }

    #[test]
    fn numbers_of_a_series_lie_between_its_rows() {
        let text = cosine();
        let found = |of, time| of_series(&text, "x", of, time).unwrap();
        let pi = std::f64::consts::PI;
        assert!((found(SeriesNumber::At, None) - 12_f64.cos()).abs() < 1e-12);
        assert!((found(SeriesNumber::At, Some(1.23)) - 3.69_f64.cos()).abs() < 1e-3);
        assert!((found(SeriesNumber::Zero, None) - pi / 6.0).abs() < 1e-4);
        assert!((found(SeriesNumber::Zero, Some(0.6)) - pi / 2.0).abs() < 1e-4);
        assert!((found(SeriesNumber::Max, Some(1.0)) - 1.0).abs() < 1e-3);
        assert!((found(SeriesNumber::Min, None) + 1.0).abs() < 1e-3);
        assert!((found(SeriesNumber::Mean, None) - 12_f64.sin() / 12.0).abs() < 1e-3);
    }

    #[test]
    fn what_a_series_lacks_is_said() {
        let text = cosine();
        let error = |name, of, time| of_series(&text, name, of, time).unwrap_err();
        assert!(error("y", SeriesNumber::At, None).contains("it has time, x"));
        assert!(error("x", SeriesNumber::At, Some(5.0)).contains("ends before time 5"));
        assert!(error("x", SeriesNumber::Zero, Some(3.9)).contains("does not pass zero"));
        assert!(error("x", SeriesNumber::Mean, Some(9.0)).contains("no rows"));
        assert!(of_series("time,x\n", "x", SeriesNumber::At, None).is_err());
    }
}
