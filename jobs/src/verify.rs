//! `verify`: runs the rows that scenes must show and compares figures. Runs are jobs of one thread in a directory of
//! their own; those of this build that are already there are not repeated.

mod figures;
mod measure;
mod table;

pub use table::Outcome;

use crate::system::build;
use crate::system::digest;
use crate::worker::local_run::{self, Keep};
use meniscus::scene::SceneKind;
use meniscus::scene::rows::{Figure, Row};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// What to verify, and where.
#[derive(Debug, Clone)]
pub struct Request {
    /// Kinds of scenes; all when empty.
    pub only: Vec<String>,
    /// Whether long rows run too, and the results are written.
    pub full: bool,
    /// Where runs are kept.
    pub runs: PathBuf,
    /// Where the tables and pictures go when everything is run.
    pub results: PathBuf,
}

/// Why a verification cannot begin or go on.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// No such kind.
    #[error("there is no kind of scene named {name}; there are {known}")]
    UnknownKind {
        /// As asked for.
        name: String,
        /// Those there are.
        known: String,
    },
    /// A file.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// A picture.
    #[error("picture {name}: {cause}")]
    Picture {
        /// Which.
        name: &'static str,
        /// Why.
        cause: String,
    },
}

/// Runs the rows and hands each outcome to `shown` as it comes. Returns whether every row is met.
///
/// # Errors
/// [`VerifyError`].
pub fn verify(request: &Request, mut shown: impl FnMut(&Outcome) -> io::Result<()>) -> Result<bool, VerifyError> {
    let known: Vec<&str> = meniscus::scenes::SCENES.iter().map(|kind| kind.kind).collect();
    if let Some(name) = request.only.iter().find(|name| !known.contains(&name.as_str())) {
        return Err(VerifyError::UnknownKind { name: name.clone(), known: known.join(", ") });
    }
    let is_wanted = |kind: &&&SceneKind| request.only.is_empty() || request.only.iter().any(|name| name == kind.kind);
    let bench = Bench { runs: request.runs.join(build_key()) };
    let mut all_met = true;
    let mut documents: BTreeMap<&str, (Vec<Outcome>, Vec<Figure>)> = BTreeMap::new();
    for kind in meniscus::scenes::SCENES.iter().filter(is_wanted) {
        let rows = (kind.rows)();
        let (outcomes, figures) = documents.entry(rows.document).or_default();
        for row in rows.rows.iter().filter(|row| request.full || !row.is_long) {
            let outcome = bench.outcome(kind.kind, row);
            all_met &= outcome.is_met;
            shown(&outcome)?;
            outcomes.push(outcome);
        }
        figures.extend(rows.figures);
    }
    let mut undrawn = None;
    for (name, (outcomes, figures)) in documents.iter().filter(|_| request.full) {
        fs::create_dir_all(&request.results)?;
        // A document that several kinds share is not replaced by the table of one.
        let sharing = meniscus::scenes::SCENES.iter().filter(|kind| (kind.rows)().document == *name);
        let is_whole = sharing.clone().all(|kind| is_wanted(&kind));
        let part: Vec<&str> = sharing.filter(|kind| !is_whole && is_wanted(kind)).map(|kind| kind.kind).collect();
        let file = std::iter::once(*name).chain(part).collect::<Vec<_>>().join("-");
        let notes = format!("{file}-notes.md");
        let notes = request.results.join(&notes).is_file().then_some(notes);
        let text = table::document(outcomes, figures, notes.as_deref());
        fs::write(request.results.join(format!("{file}.md")), text)?;
        // The table stands whatever becomes of the pictures, and each of them whatever becomes of the others.
        for figure in figures {
            let path = request.results.join(format!("{}.svg", figure.name));
            if let Err(cause) = bench.draw(figure, &path) {
                undrawn = undrawn.or(Some(VerifyError::Picture { name: figure.name, cause }));
            }
        }
    }
    undrawn.map_or(Ok(all_met), Err)
}

/// A name for this build, so that runs of another one are not taken for its own.
fn build_key() -> String {
    let own = std::env::current_exe().ok().and_then(|path| digest::of_file(&path).ok());
    own.map_or_else(build::name, |(digest, _)| digest[..16].to_owned())
}

/// Runs scenes and keeps what they report.
struct Bench {
    runs: PathBuf,
}

impl Bench {
    fn outcome(&self, kind: &str, row: &Row) -> Outcome {
        let mut reports = Vec::new();
        let mut failure = None;
        for scene in &row.runs {
            match self.report(scene) {
                Ok(report) => reports.push(report),
                Err(cause) => failure = failure.or(Some(cause)),
            }
        }
        let figure = if failure.is_none() { measure::measure(row.measure, &row.runs, &reports) } else { f64::NAN };
        let cpu_s = reports.iter().filter_map(|report| report["cost"]["cpu_s"].as_f64()).sum();
        Outcome::new(kind, row, figure, cpu_s, failure)
    }

    /// The report of a scene: of its earlier run with this build, or of one made now.
    fn report(&self, scene: &Value) -> Result<Value, String> {
        let directory = self.ran(&json!({"scene": scene}), Keep::Report)?;
        read_report(&directory).ok_or_else(|| "the run left no report".to_owned())
    }

    /// Where a run of this build is kept: an earlier one, or one made now.
    fn ran(&self, body: &Value, keep: Keep) -> Result<PathBuf, String> {
        let key = format!("{body} {keep:?}");
        let directory = self.runs.join(&digest::of_bytes(key.as_bytes())[..16]);
        if read_report(&directory).is_none() {
            local_run::run(body, &directory, 1, keep)?;
        }
        Ok(directory)
    }
}

fn read_report(directory: &Path) -> Option<Value> {
    serde_json::from_slice(&fs::read(directory.join("report.json")).ok()?).ok()
}
