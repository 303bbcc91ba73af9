//! `verify`: runs the verification cases and compares their values with the targets. Runs are jobs of one thread in a
//! directory of their own; those of this build that are already there are not repeated.

pub mod bad_case;
pub mod case;
pub mod catalog;
pub mod checks;
mod document;
pub mod measure;
mod outcome;
pub mod plot;
mod plots;
mod studies;
pub mod study_case;
mod workspace;

pub use case::{Case, CaseError};
pub use catalog::{Catalog, KindCases};
pub use outcome::Outcome;
pub use plot::Plot;

use document::KindOutcomes;
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::PathBuf;
use workspace::Workspace;

/// What to verify, and where.
#[derive(Debug, Clone)]
pub struct Request {
    /// Kinds of scenes; all when empty.
    pub only: Vec<String>,
    /// Whether long targets are measured too, and the results are written.
    pub full: bool,
    /// Directory of the cases; those that the program carries when not given.
    pub cases: Option<PathBuf>,
    /// Where runs are kept.
    pub runs: PathBuf,
    /// Where the documents and plots go when everything is run.
    pub results: PathBuf,
}

/// Why a verification cannot begin or go on.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// No such kind.
    #[error("there is no kind of scene named {name}; there are {known}")]
    UnknownKind {
        /// The name asked for.
        name: String,
        /// The kinds there are.
        known: String,
    },
    /// The file of a case or plot cannot be used.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// A file cannot be read or written.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// A plot cannot be drawn.
    #[error("plot {name}: {cause}")]
    Plot {
        /// Name of the plot.
        name: String,
        /// Why it cannot be drawn.
        cause: String,
    },
}

/// Runs the cases and hands each outcome to `show` as it comes. Returns whether every target is met.
///
/// # Errors
/// [`VerifyError`].
pub fn verify(request: &Request, mut show: impl FnMut(&Outcome) -> io::Result<()>) -> Result<bool, VerifyError> {
    let catalog = request.cases.as_deref().map_or_else(Catalog::built_in, Catalog::from_directory)?;
    let kinds = catalog.kinds.iter().map(|kind| kind.kind);
    let known: Vec<&str> = kinds.chain(std::iter::once(catalog::STUDIES)).collect();
    if let Some(name) = request.only.iter().find(|name| !known.contains(&name.as_str())) {
        return Err(VerifyError::UnknownKind { name: name.clone(), known: known.join(", ") });
    }
    let is_wanted = |kind: &KindCases| request.only.is_empty() || request.only.iter().any(|name| name == kind.kind);
    let workspace = Workspace::new(&request.runs);
    let mut all_met = true;
    let mut documents: BTreeMap<&str, Vec<KindOutcomes>> = BTreeMap::new();
    for cases in catalog.kinds.iter().filter(|kind| is_wanted(kind)) {
        let mut outcomes = Vec::new();
        for (name, case) in &cases.cases {
            let name = format!("{}/{name}", cases.kind);
            let mut of_case = Vec::new();
            for target in case.targets.iter().filter(|target| request.full || !target.is_long) {
                let outcome = Outcome::of_target(&name, case, target, |_, body| workspace.finish(body));
                all_met &= outcome.is_met;
                show(&outcome)?;
                of_case.push(outcome);
            }
            outcomes.push(of_case);
        }
        documents.entry(&cases.document).or_default().push(KindOutcomes { cases, outcomes });
    }
    let has_studies =
        request.only.iter().any(|name| name == catalog::STUDIES) || request.full && request.only.is_empty();
    if has_studies {
        all_met &= verify_studies(request, &catalog, &workspace, &mut show)?;
    }
    let mut undrawn = None;
    if request.full {
        for (name, results) in &documents {
            // A document that several kinds share is not replaced by the results of one.
            let sharing = catalog.kinds.iter().filter(|kind| kind.document == *name);
            let is_whole = sharing.clone().all(is_wanted);
            let part: Vec<&str> = sharing.filter(|kind| !is_whole && is_wanted(kind)).map(|kind| kind.kind).collect();
            let file = std::iter::once(*name).chain(part).collect::<Vec<_>>().join("-");
            undrawn = write_results(request, &workspace, &file, results)?.or(undrawn);
        }
    }
    undrawn.map_or(Ok(all_met), Err)
}

/// Runs the cases of studies, and writes their document where everything is measured. Returns whether every target is met.
fn verify_studies(
    request: &Request,
    catalog: &Catalog,
    workspace: &Workspace,
    show: &mut dyn FnMut(&Outcome) -> io::Result<()>,
) -> io::Result<bool> {
    let mut all = Vec::new();
    for (name, case) in &catalog.studies {
        let (outcomes, lines) =
            studies::outcomes(workspace, &format!("{}/{name}", catalog::STUDIES), case, request.full, show)?;
        all.push((case, outcomes, lines));
    }
    if request.full {
        fs::create_dir_all(&request.results)?;
        fs::write(request.results.join("studies.md"), document::compose_studies(&all))?;
    }
    Ok(all.iter().flat_map(|(_, outcomes, _)| outcomes).all(|outcome| outcome.is_met))
}

/// Writes a document and draws its plots. Returns why a plot could not be drawn; the others are drawn all the same.
fn write_results(
    request: &Request,
    workspace: &Workspace,
    file: &str,
    results: &[KindOutcomes],
) -> io::Result<Option<VerifyError>> {
    fs::create_dir_all(&request.results)?;
    let notes = format!("{file}-notes.md");
    let notes = request.results.join(&notes).is_file().then_some(notes);
    fs::write(request.results.join(format!("{file}.md")), document::compose(results, notes.as_deref()))?;
    let mut failed = None;
    for (name, plot) in results.iter().flat_map(|result| &result.cases.plots) {
        if let Err(cause) = workspace.draw(plot, &request.results.join(format!("{name}.svg"))) {
            failed = failed.or(Some(VerifyError::Plot { name: name.clone(), cause }));
        }
    }
    Ok(failed)
}
