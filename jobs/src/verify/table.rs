//! Outcomes as lines of a table and as a document.

use crate::system::clock;
use crate::system::process;
use meniscus::scene::rows::{Figure, Reach, Row};
use std::fmt::{Display, Formatter, Write};

/// One row with its figure.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Kind of scene.
    pub kind: String,
    /// What is shown.
    pub case: String,
    /// The paper's figure.
    pub paper: &'static str,
    /// What is to be reached.
    pub reach: Reach,
    /// The figure; NaN when there is none.
    pub figure: f64,
    /// CPU seconds of all its runs.
    pub cpu_s: f64,
    /// Whether it is met.
    pub is_met: bool,
    /// Why there is no figure.
    pub failure: Option<String>,
}

impl Outcome {
    pub(super) fn new(kind: &str, row: &Row, figure: f64, cpu_s: f64, failure: Option<String>) -> Self {
        Self {
            kind: kind.to_owned(),
            case: row.case.clone(),
            paper: row.paper,
            reach: row.reach,
            figure,
            cpu_s,
            is_met: row.reach.is_met(figure),
            failure,
        }
    }

    fn verdict(&self) -> &str {
        match (&self.failure, self.reach, self.is_met) {
            (Some(cause), _, _) => cause,
            (None, Reach::Shown, true) => "",
            (None, _, true) => "met",
            (None, _, false) => "missed",
        }
    }
}

/// A figure as people write it.
fn number(value: f64) -> String {
    if (0.01..1000.0).contains(&value.abs()) { format!("{value:.3}") } else { format!("{value:.2e}") }
}

fn wanted(reach: Reach) -> String {
    match reach {
        Reach::AtMost(most) => format!("≤ {}", number(most)),
        Reach::AtLeast(least) => format!("≥ {}", number(least)),
        Reach::Within { of, by } => format!("{} ± {}", number(of), number(by)),
        Reach::Shown => "–".to_owned(),
    }
}

impl Display for Outcome {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let (reach, figure) = (wanted(self.reach), number(self.figure));
        write!(
            f,
            "{:<11} {:<58} {:>20}  {:>18} {:>10} {:>8.1} s  {}",
            self.kind,
            self.case,
            self.paper,
            reach,
            figure,
            self.cpu_s,
            self.verdict()
        )
    }
}

/// A table as a Markdown document; `notes` names a file beside it that tells more.
pub(super) fn document(outcomes: &[Outcome], figures: &[Figure], notes: Option<&str>) -> String {
    let mut kinds: Vec<&str> = outcomes.iter().map(|outcome| outcome.kind.as_str()).collect();
    kinds.dedup();
    let kinds = kinds.join(",");
    let mut text = String::new();
    let date = clock::now();
    let machine = process::cpu_name().unwrap_or_else(|| "unknown".to_owned());
    let (build, isa) = (crate::system::build::name(), crate::system::build::isa());
    let missed = outcomes.iter().filter(|outcome| !outcome.is_met).count();
    // Writing to a String cannot fail.
    let _ = write!(
        text,
        "# {kinds}: what was to be shown, and what was measured\n\n\
         Written by `meniscus verify --only {kinds} --full` on {}; machine: {machine} ({isa}), one core; build {build}.\n\
         {} rows, {missed} missed. Times are CPU seconds of all runs of a row, set-up and references included.\n\n\
         | case | paper | to reach | measured | time | verdict |\n| --- | --- | --- | --- | --- | --- |\n",
        &date[..10.min(date.len())],
        outcomes.len(),
    );
    for outcome in outcomes {
        let _ = writeln!(
            text,
            "| {}: {} | {} | {} | {} | {:.1} s | {} |",
            outcome.kind,
            outcome.case,
            outcome.paper,
            wanted(outcome.reach),
            number(outcome.figure),
            outcome.cpu_s,
            outcome.verdict()
        );
    }
    if let Some(notes) = notes {
        let _ = write!(text, "\nWhat was tried, and why rows are missed: [{notes}]({notes}).\n");
    }
    for figure in figures {
        let _ = write!(text, "\n![{}]({}.svg)\n", figure.title, figure.name);
    }
    text
}
