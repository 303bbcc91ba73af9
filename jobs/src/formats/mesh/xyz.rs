//! Points as lines of numbers (XYZ, ASC, TXT, CSV, PTS): two or three coordinates, then perhaps a normal, colors and other
//! values. Numbers are separated by blanks, tabs, commas or semicolons. A line of names or of the number of points may come
//! first.

use super::text::{has_decimal_comma, lines, no_number, real};
use super::{Mesh, check_count};

/// Numbers of a line at most.
const MOST_COLUMNS: usize = 64;
/// Largest deviation of the length of a normal from 1, where other values may stand in its place.
const UNIT: f64 = 1e-2;

/// Reads positions and normals.
pub(super) fn read(text: &str) -> Result<Mesh, String> {
    let mut mesh = Mesh::default();
    let mut rows = Rows::default();
    let mut is_first = true;
    for (number, line) in lines(text) {
        let line = line.split(['#', '!']).next().unwrap_or_default().split("//").next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let was_first = std::mem::take(&mut is_first);
        if was_first && is_heading(line) {
            continue;
        }
        check_count(mesh.points.len())?;
        let numbers = numbers(line, number)?;
        let [x, y, rest @ ..] = numbers.as_slice() else {
            return Err(format!("line {number} has 1 number; 2 or 3 coordinates are needed"));
        };
        if let Some((columns, first)) = rows.columns
            && columns != numbers.len()
        {
            return Err(format!(
                "line {number} has {} numbers, but line {first} has {columns}; all lines must have the same columns",
                numbers.len()
            ));
        }
        rows.columns.get_or_insert((numbers.len(), number));
        mesh.points.push([*x, *y, rest.first().copied().unwrap_or(0.0)]);
        rows.look_at(rest.get(1..).unwrap_or_default());
    }
    mesh.normals = rows.normals();
    Ok(mesh)
}

/// Whether a line is a heading: names of columns, or the number of points alone.
fn is_heading(line: &str) -> bool {
    let mut words = line.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty());
    let is_name =
        |word: &str| word.parse::<f64>().is_err() && word.starts_with(|c: char| c.is_alphabetic() || c == '"');
    line.parse::<u64>().is_ok() || words.all(is_name)
}

/// The numbers of a line.
fn numbers(line: &str, number: usize) -> Result<Vec<f64>, String> {
    let fields: Vec<&str> = line.split([' ', '\t', ';']).filter(|word| !word.is_empty()).collect();
    // A comma within a word, beside other separators, is a decimal comma.
    if fields.len() > 1
        && let Some(word) = fields.iter().find(|word| has_decimal_comma(word))
    {
        return Err(format!("line {number}: {}", no_number(word)));
    }
    let words: Vec<&str> = line.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty()).collect();
    if words.len() > MOST_COLUMNS {
        return Err(format!("line {number} has {} numbers; at most {MOST_COLUMNS} are read", words.len()));
    }
    // "0,8394,0,0130": whole numbers by turns with digits that only a fraction begins or has so many of.
    let is_whole = |word: &&str| word.trim_start_matches(['-', '+']).bytes().all(|byte| byte.is_ascii_digit());
    let is_fraction = |word: &&str| word.len() > 3 || (word.len() > 1 && word.starts_with('0'));
    if fields.len() == 1
        && words.len() >= 4
        && words.len().is_multiple_of(2)
        && words.iter().all(is_whole)
        && words.iter().skip(1).step_by(2).any(is_fraction)
    {
        let pair = format!("{},{}", words[0], words[1]);
        return Err(format!("line {number}: {}", no_number(&pair)));
    }
    words.iter().map(|word| real(word, number)).collect()
}

/// What stands behind the coordinates.
#[derive(Default)]
struct Rows {
    /// Number of columns, and the line that has it.
    columns: Option<(usize, usize)>,
    /// Columns 4 to 6 and 7 to 9 of each line, as far as there are some.
    triples: [Vec<[f64; 3]>; 2],
}

impl Rows {
    fn look_at(&mut self, rest: &[f64]) {
        let (triples, _) = rest.as_chunks::<3>();
        self.triples.iter_mut().zip(triples).for_each(|(list, triple)| list.push(*triple));
    }

    /// Three numbers behind the coordinates are a normal unless they are colors. Among more numbers the first three that have
    /// the length 1 in every line are.
    fn normals(self) -> Vec<[f64; 3]> {
        let is_color = |c: &f64| c.fract() == 0.0 && (0.0..=255.0).contains(c);
        let are_colors = |list: &[[f64; 3]]| {
            list.as_flattened().iter().all(is_color) && list.as_flattened().iter().any(|c| *c > 1.0)
        };
        let is_unit = |n: &[f64; 3]| (n[0].hypot(n[1]).hypot(n[2]) - 1.0).abs() < UNIT;
        let [first, second] = self.triples;
        match self.columns {
            Some((6, _)) if !are_colors(&first) => first,
            Some((7.., _)) if first.iter().all(is_unit) => first,
            Some((9.., _)) if second.iter().all(is_unit) => second,
            _ => Vec::new(),
        }
    }
}
