//! The results of full verifications as a Markdown document.

use super::catalog::KindCases;
use super::outcome::{Outcome, number};
use super::study_case::StudyCase;
use crate::system::{build, clock, process};
use std::fmt::Write;

/// The outcomes of the targets of one kind, case by case.
pub(super) struct KindOutcomes<'a> {
    pub cases: &'a KindCases,
    /// For each case its outcomes, in the order of its targets.
    pub outcomes: Vec<Vec<Outcome>>,
}

/// The document of some kinds; `notes` names a file beside it that tells more.
pub(super) fn compose(results: &[KindOutcomes], notes: Option<&str>) -> String {
    let kinds: Vec<&str> = results.iter().map(|result| result.cases.kind).collect();
    let kinds = kinds.join(",");
    let all = || results.iter().flat_map(|result| result.outcomes.iter().flatten());
    let (count, missed) = (all().count(), all().filter(|outcome| !outcome.is_met).count());
    let date = clock::now();
    let machine = process::cpu_name().unwrap_or_else(|| "unknown".to_owned());
    let (build, isa) = (build::name(), build::isa());
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write!(
        text,
        "# {kinds}: targets and measured values\n\n\
         Written by `meniscus verify --only {kinds} --full` on {}; machine: {machine} ({isa}), one core; build {build}.\n\
         {count} targets, {missed} missed. Times are CPU seconds of all runs of a target, set-up and references included.\n\
         Each case is a file of `tests/validation/cases`; `meniscus run FILE --out DIR` runs it by itself.\n",
        &date[..10.min(date.len())],
    );
    for result in results {
        for ((name, case), outcomes) in result.cases.cases.iter().zip(&result.outcomes) {
            let _ = write!(text, "\n## {}\n\n`{}/{name}`. {}.\n", case.title, result.cases.kind, case.source);
            text.push_str(
                "\n| target | paper | to reach | measured | time | verdict |\n| --- | --- | --- | --- | --- | --- |\n",
            );
            for outcome in outcomes {
                let _ = writeln!(
                    text,
                    "| {} | {} | {} | {} | {:.1} s | {} |",
                    outcome.title,
                    outcome.paper(),
                    outcome.bound,
                    number(outcome.value),
                    outcome.cpu_s,
                    outcome.verdict()
                );
            }
        }
    }
    if let Some(notes) = notes {
        let _ = write!(text, "\nWhat was tried, and why targets are missed: [{notes}]({notes}).\n");
    }
    for (name, plot) in results.iter().flat_map(|result| &result.cases.plots) {
        let _ = write!(text, "\n![{}]({name}.svg)\n", plot.title);
    }
    text
}

/// The document of the cases of studies: their outcomes, and a line for every trial.
pub(super) fn compose_studies(cases: &[(&StudyCase, Vec<Outcome>, Vec<String>)]) -> String {
    let (date, build, isa) = (clock::now(), build::name(), build::isa());
    let machine = process::cpu_name().unwrap_or_else(|| "unknown".to_owned());
    let all = || cases.iter().flat_map(|(_, outcomes, _)| outcomes);
    let (count, missed) = (all().count(), all().filter(|outcome| !outcome.is_met).count());
    let mut text = format!(
        "# studies: accuracies that were asked for, orders, and series that are recognized\n\n\
         Written by `meniscus verify --only studies --full` on {}; machine: {machine} ({isa}), one core; build {build}.\n\
         {count} targets, {missed} missed. A trial is a scene without a spacing and a tolerance; a small study finds the spacing, and the run\n\
         follows. The best set-up by hand is the cheapest run that meets the tolerance, over the set-ups of the case and over spacings a tenth\n\
         apart; what it cost to find it is not counted. Frames and the last checkpoint are part of every run, and most of the cost of a run of\n\
         some hundredths of a second. Runs under 0.3 s are timed five times, and the least time counts.\n",
        &date[..10.min(date.len())],
    );
    for (case, outcomes, lines) in cases {
        text.push_str(&format!(
            "\n## {}\n\n{}.\n\n| target | to reach | measured | time | verdict |\n",
            case.title, case.source
        ));
        text.push_str("| --- | --- | --- | --- | --- |\n");
        for outcome in outcomes {
            text.push_str(&format!(
                "| {} | {} | {} | {:.1} s | {} |\n",
                outcome.title,
                outcome.bound,
                number(outcome.value),
                outcome.cpu_s,
                outcome.verdict()
            ));
        }
        if !lines.is_empty() {
            text.push_str("\n| trial | scene | tolerance | reached | spacing | run, s | with study, s | by hand, s | ratio of runs |\n");
            text.push_str("| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
            text.push_str(&lines.join("\n"));
            text.push('\n');
        }
    }
    text
}
