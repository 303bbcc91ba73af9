//! The table of checks: bad runs, in which a check must fire, and examples and verification cases, in which none may.

use super::bad_case::{BadCase, Fate};
use super::case::{CaseError, job_body};
use super::catalog::{self, Catalog};
use super::workspace::Workspace;
use super::{Request, VerifyError};
use crate::spec::health::HealthRecord;
use crate::system::{build, clock, process};
use meniscus::scenes::SCENES;
use meniscus::simulation::{Check, Severity};
use serde_json::Value;
use std::fmt::Write;
use std::{fs, io};

/// Name of the document.
const DOCUMENT: &str = "checks.md";

/// What became of a run.
struct Row {
    name: String,
    title: String,
    expected: Option<Fate>,
    found: Fate,
    /// The check that came nearest to its limit.
    tightest: String,
    findings: String,
}

impl Row {
    fn is_met(&self) -> bool {
        match &self.expected {
            Some(expected) => *expected == self.found,
            // A good run may have doubts; no check may end it.
            None => !matches!(self.found, Fate::Ended(_) | Fate::Refused(_)),
        }
    }
}

/// Runs the bad cases, the examples and the verification cases (with `full` the long ones too), hands a line of each to `show` and writes the
/// table. Returns whether every check fires where it must and nowhere else.
///
/// # Errors
/// [`VerifyError`].
pub fn run(request: &Request, mut show: impl FnMut(&str) -> io::Result<()>) -> Result<bool, VerifyError> {
    let catalog = request.cases.as_deref().map_or_else(Catalog::built_in, Catalog::from_directory)?;
    let workspace = Workspace::new(&request.runs);
    let is_wanted = |kind: &str| request.only.is_empty() || request.only.iter().any(|name| name == kind);
    let mut rows = Vec::new();
    let mut take = |row: Row| -> io::Result<()> {
        let verdict = if row.is_met() { "ok" } else { "MISSED" };
        let expected = row.expected.as_ref().map_or_else(|| "no check fires".to_owned(), ToString::to_string);
        show(&format!("{:<44} {expected}; it {}; {verdict}", row.name, row.found))?;
        rows.push(row);
        Ok(())
    };
    for (name, case) in bad_cases()?.into_iter().filter(|(name, _)| is_wanted(kind_of(name))) {
        take(row(&workspace, &name, &case.title, &case.body(), Some(case.expect.clone())))?;
    }
    for kind in SCENES.iter().filter(|kind| is_wanted(kind.kind)) {
        let example: Value = serde_json::from_str(kind.example).map_err(io::Error::from)?;
        take(row(&workspace, &format!("{}/example", kind.kind), "The example", &example, None))?;
    }
    for cases in catalog.kinds.iter().filter(|kind| is_wanted(kind.kind)) {
        for (name, case) in &cases.cases {
            let mut names: Vec<&str> = Vec::new();
            for target in case.targets.iter().filter(|target| request.full || !target.is_long) {
                names.extend(case.runs_of(target).map(|(run, _)| run));
            }
            for (run, written) in case.runs.iter().filter(|(run, _)| names.contains(&run.as_str())) {
                let name = format!("{}/{name}/{run}", cases.kind);
                take(row(&workspace, &name, &case.title, &job_body(written), None))?;
            }
        }
    }
    fs::create_dir_all(&request.results)?;
    fs::write(request.results.join(DOCUMENT), compose(&rows, request))?;
    Ok(rows.iter().all(Row::is_met))
}

/// The bad runs that the program carries, by name.
///
/// # Errors
/// [`CaseError`] of the first file that cannot be used.
pub fn bad_cases() -> Result<Vec<(String, BadCase)>, CaseError> {
    let parse = |(file, text): &(&str, &str)| {
        let case = BadCase::parse(file, text.as_bytes())?;
        Ok((file.trim_end_matches(".json").to_owned(), case))
    };
    catalog::built_in_bad_files().iter().map(parse).collect()
}

fn kind_of(name: &str) -> &str {
    name.split('/').next().unwrap_or_default()
}

fn row(workspace: &Workspace, name: &str, title: &str, body: &Value, expected: Option<Fate>) -> Row {
    let (found, report) = workspace.fate(body, expected.as_ref());
    let health = report.as_ref().map(|report| &report.health);
    Row {
        name: name.to_owned(),
        title: title.to_owned(),
        expected,
        found,
        tightest: health.map(tightest).unwrap_or_default(),
        findings: health.map(findings).unwrap_or_default(),
    }
}

/// The check that came nearest to its limit at the end.
fn tightest(health: &HealthRecord) -> String {
    let share = |check: &Check| Some(check.value? / check.limit.filter(|limit| *limit != 0.0)?);
    let nearest =
        health.checks.iter().filter_map(|check| Some((check, share(check)?))).max_by(|a, b| a.1.total_cmp(&b.1));
    nearest.map_or_else(String::new, |(check, _)| {
        format!("{} {:.2e} of {:.2e}", check.name, check.value.unwrap_or(0.0), check.limit.unwrap_or(0.0))
    })
}

/// Codes of the warnings.
fn findings(health: &HealthRecord) -> String {
    let warnings = health.findings.iter().filter(|finding| finding.severity == Severity::Warning);
    let mut codes: Vec<&str> = warnings.map(|finding| finding.code.as_ref()).collect();
    codes.dedup();
    codes.join(", ")
}

fn compose(rows: &[Row], request: &Request) -> String {
    let date = clock::now();
    let machine = process::cpu_name().unwrap_or_else(|| "unknown".to_owned());
    let missed = rows.iter().filter(|row| !row.is_met()).count();
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write!(
        text,
        "# Checks: where they fire, and where they must not\n\n\
         Written by `meniscus verify --checks{}{}` on {}; machine: {machine} ({}), one core; build {}. {} runs, {missed} missed.\n\
         The limits and their reasons stand in the README of each scene (`src/scenes/KIND/README.md`, Checks).\n\n\
         ## Bad runs\n\nEach is a file of `tests/validation/bad`.\n\n\
         | run | what | must | does | verdict |\n| --- | --- | --- | --- | --- |\n",
        if request.full { " --full" } else { "" },
        if request.only.is_empty() { String::new() } else { format!(" --only {}", request.only.join(",")) },
        &date[..10.min(date.len())],
        build::isa(),
        build::name(),
        rows.len(),
    );
    let verdict = |row: &Row| if row.is_met() { "met" } else { "**missed**" };
    for row in rows {
        if let Some(expected) = &row.expected {
            let Row { name, title, found, .. } = row;
            let _ = writeln!(text, "| `{name}` | {title} | {expected} | {found} | {} |", verdict(row));
        }
    }
    text.push_str(
        "\n## Examples and verification cases\n\nNo check may end one of these.\n\n\
         | run | does | nearest to a limit at the end | doubts | verdict |\n| --- | --- | --- | --- | --- |\n",
    );
    for row in rows.iter().filter(|row| row.expected.is_none()) {
        let Row { name, found, tightest, findings, .. } = row;
        let _ = writeln!(text, "| `{name}` | {found} | {tightest} | {findings} | {} |", verdict(row));
    }
    text
}
