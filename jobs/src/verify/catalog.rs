//! The verification cases and plots of every kind of scene: those that the program carries, or those of a directory.
//!
//! ```text
//! documents.json           names of the result documents with the kinds that share each
//! KIND/NAME.json           a case
//! KIND/plots/NAME.json     a plot
//! studies/NAME.json        a case of studies and accuracies
//! ```

use super::case::{Case, CaseError, parse};
use super::plot::Plot;
use super::study_case::StudyCase;
use meniscus::scenes::SCENES;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

mod built_in {
    include!(concat!(env!("OUT_DIR"), "/verification_cases.rs"));
}

/// Names and texts of the files that the program carries, by the name below `tests/validation/cases`.
#[must_use]
pub fn built_in_files() -> &'static [(&'static str, &'static str)] {
    built_in::FILES
}

/// The same of the bad runs, by the name below `tests/validation/bad`.
#[must_use]
pub fn built_in_bad_files() -> &'static [(&'static str, &'static str)] {
    built_in::BAD_FILES
}

/// The file that says which kinds share a document.
const DOCUMENTS: &str = "documents.json";

/// The cases of a kind of scene.
#[derive(Debug, Clone)]
pub struct KindCases {
    /// Kind of scene, or [`INPUTS`] or [`WALLS`].
    pub kind: &'static str,
    /// Name of the document with its results; kinds may share one.
    pub document: String,
    /// Cases in the order of their names.
    pub cases: Vec<(String, Case)>,
    /// Plots in the order of their names, which are those of the pictures.
    pub plots: Vec<(String, Plot)>,
}

/// All cases, by kind.
#[derive(Debug, Clone)]
pub struct Catalog {
    /// The kinds in the order of the engine's list, then the inputs of one's own and droplets among walls; those without cases have
    /// empty lists.
    pub kinds: Vec<KindCases>,
    /// The cases of studies, in the order of their names.
    pub studies: Vec<(String, StudyCase)>,
}

/// The folder of the cases of inputs of one's own, whose runs are of any kind, and their name among the kinds.
pub const INPUTS: &str = "inputs";
/// The folder of the cases of droplets among walls, and their name among the kinds.
pub const WALLS: &str = "walls";
/// The folder of the cases of studies, and their name among the kinds.
pub const STUDIES: &str = "studies";

impl Catalog {
    /// The cases that the program carries.
    ///
    /// # Errors
    /// [`CaseError`] of the first file that cannot be used.
    pub fn built_in() -> Result<Self, CaseError> {
        Self::from_files(built_in_files().iter().map(|(name, text)| ((*name).to_owned(), text.as_bytes().to_vec())))
    }

    /// The cases of a directory.
    ///
    /// # Errors
    /// [`CaseError`] of the first file that cannot be read or used.
    pub fn from_directory(directory: &Path) -> Result<Self, CaseError> {
        let mut files = Vec::new();
        collect(directory, directory, &mut files)?;
        files.sort();
        Self::from_files(files)
    }

    /// From files by their names below the directory of cases, in the order of these names.
    fn from_files(files: impl IntoIterator<Item = (String, Vec<u8>)>) -> Result<Self, CaseError> {
        let mut documents: BTreeMap<String, Vec<String>> = BTreeMap::new();
        let empty = |kind| KindCases { kind, document: String::new(), cases: Vec::new(), plots: Vec::new() };
        let mut kinds: Vec<KindCases> = SCENES.iter().map(|kind| kind.kind).chain([INPUTS, WALLS]).map(empty).collect();
        let mut studies = Vec::new();
        for (file, text) in files {
            if let Some(name) = file.strip_prefix("studies/").and_then(|name| name.strip_suffix(".json")) {
                studies.push((name.to_owned(), StudyCase::parse(&file, &text)?));
                continue;
            }
            if file == DOCUMENTS {
                documents = parse(&file, &text)?;
                continue;
            }
            let refuse = |cause: String| CaseError { file: file.clone(), place: "name".to_owned(), cause };
            let parts: Vec<&str> = file.trim_end_matches(".json").split('/').collect();
            let known = || SCENES.iter().map(|kind| kind.kind).chain([INPUTS, WALLS]).collect::<Vec<_>>().join(", ");
            let (folder, name, is_plot) = match parts[..] {
                [folder, name] => (folder, name, false),
                [folder, "plots", name] => (folder, name, true),
                _ => return Err(refuse("cases are KIND/NAME.json, plots KIND/plots/NAME.json".to_owned())),
            };
            let Some(kind) = kinds.iter_mut().find(|kind| kind.kind == folder) else {
                return Err(refuse(format!("there is no kind of scene named {folder}; there are {}", known())));
            };
            if is_plot {
                kind.plots.push((name.to_owned(), Plot::parse(&file, &text)?));
            } else {
                kind.cases.push((name.to_owned(), Case::parse(&file, &text)?));
            }
        }
        for kind in &mut kinds {
            let shared = documents.iter().find(|(_, of)| of.iter().any(|name| name == kind.kind));
            kind.document = shared.map_or(kind.kind, |(name, _)| name).to_owned();
        }
        Ok(Self { kinds, studies })
    }
}

/// Reads the JSON files of a directory and those below it.
fn collect(root: &Path, directory: &Path, files: &mut Vec<(String, Vec<u8>)>) -> Result<(), CaseError> {
    let name = |path: &Path| path.strip_prefix(root).unwrap_or(path).display().to_string();
    let failed = |path: &Path, cause: std::io::Error| CaseError {
        file: path.display().to_string(),
        place: "file".to_owned(),
        cause: cause.to_string(),
    };
    for entry in fs::read_dir(directory).map_err(|cause| failed(directory, cause))? {
        let path = entry.map_err(|cause| failed(directory, cause))?.path();
        if path.is_dir() {
            collect(root, &path, files)?;
        } else if path.extension().is_some_and(|extension| extension == "json") {
            let text = fs::read(&path).map_err(|cause| failed(&path, cause))?;
            files.push((name(&path), text));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::Catalog;

    fn error_of(name: &str, text: &str) -> String {
        Catalog::from_files([(name.to_owned(), text.as_bytes().to_vec())]).unwrap_err().to_string()
    }

    #[test]
    fn files_in_the_wrong_place_are_refused() {
        let message = error_of("droplets/a.json", "{}");
        assert!(message.contains("droplets/a.json") && message.contains("redistance, vortex"), "{message}");
        assert!(error_of("droplet/pictures/a.json", "{}").contains("KIND/plots/NAME.json"));
        assert!(error_of("a.json", "{}").contains("KIND/NAME.json"));
    }

    #[test]
    fn a_plot_with_an_unknown_field_is_an_error_with_its_place() {
        let text =
            r#"{"title": "A", "plot": {"type": "frames", "run": {}, "every_time": 1.0, "frames": [0], "colour": 1}}"#;
        let message = error_of("front/plots/a.json", text);
        assert!(message.contains("front/plots/a.json: plot: unknown field `colour`"), "{message}");
    }

    #[test]
    fn kinds_that_no_document_names_have_their_own() {
        let catalog =
            Catalog::from_files([("documents.json".to_owned(), br#"{"pcp": ["redistance"]}"#.to_vec())]).unwrap();
        let documents: Vec<&str> = catalog.kinds.iter().map(|kind| kind.document.as_str()).collect();
        assert_eq!(documents[..2], ["pcp", "vortex"]);
    }
}
