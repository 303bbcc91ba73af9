//! The structure of the sources: directions of use, circles of files, lengths, words; and links of documents.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod circles;
mod code;
mod functions;
mod imports;
mod known;
mod links;

use code::{CRATES, all_sources, is_test_file, root, sources};
use imports::Crate;
use std::fs;
use std::path::Path;

/// Asserts that every file below a crate's folder mentions only modules that its `lib.rs` lists before its own.
fn assert_order(folder: &str) {
    let root = root().join(folder);
    let library = fs::read_to_string(root.join("lib.rs")).unwrap();
    let order: Vec<&str> =
        library.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';')).collect();
    assert!(order.len() > 5);
    let mut files = Vec::new();
    sources(&root, &mut files);
    for file in files {
        let relative = file.strip_prefix(&root).unwrap();
        let module = relative.components().next().unwrap().as_os_str().to_str().unwrap().trim_end_matches(".rs");
        let Some(place) = order.iter().position(|m| *m == module) else {
            continue;
        };
        for name in used_modules(&file) {
            if let Some(other) = order.iter().position(|m| *m == name) {
                assert!(other <= place, "{} uses {name}, which stands below {module}", relative.display());
            }
        }
    }
}

/// Modules of its crate that a file mentions, comments left out.
fn used_modules(file: &Path) -> Vec<String> {
    let text = fs::read_to_string(file).unwrap();
    let code: Vec<&str> = text.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    let name = |used: &str| used.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    code.join("\n").split("crate::").skip(1).map(name).collect()
}

#[test]
fn modules_use_only_modules_above_them() {
    assert_order("src");
    assert_order("jobs/src");
}

#[test]
fn a_worker_cannot_reach_the_store_and_the_service_cannot_reach_a_solver() {
    // Formats that are written and read by libhdf5, and what is below a scene: only workers and inspections use them.
    let hdf5 = ["formats::checkpoint", "formats::hdf5_file", "formats::vtkhdf", "hdf5::"];
    let solver = ["meniscus::simulation", "meniscus::schemes", ".build(", "dyn Simulation"];
    let rooms: [(&str, &[&str], &[&str]); 4] = [
        ("worker", &["service", "inspection", "verify"], &["rusqlite"]),
        ("inspection", &["service", "worker", "verify"], &["rusqlite", ".build("]),
        ("service", &["worker", "inspection", "verify"], &[hdf5.as_slice(), solver.as_slice()].concat()),
        ("verify", &["service", "inspection"], &["rusqlite"]),
    ];
    for (room, modules, texts) in rooms {
        for (path, text) in all_sources() {
            if !path.starts_with(&format!("jobs/src/{room}/")) && path != format!("jobs/src/{room}.rs") {
                continue;
            }
            let used = used_modules(&root().join(&path));
            assert!(!used.iter().any(|name| modules.contains(&name.as_str())), "{path} uses one of {modules:?}");
            for banned in texts.iter().filter(|_| !is_test_file(&path)) {
                assert!(!text.contains(banned), "{path} has {banned}");
            }
        }
    }
}

#[test]
fn the_engine_prints_nothing_opens_nothing_and_reads_no_clock() {
    let mut files = Vec::new();
    sources(&root().join("src"), &mut files);
    for file in files {
        let text = fs::read_to_string(&file).unwrap();
        for banned in ["std::fs", "std::net", "Instant::now", "SystemTime", "println!", "eprintln!", "std::env::var"] {
            assert!(!text.contains(banned), "{} uses {banned}", file.display());
        }
    }
}

/// Fails with the entries that the list in `known.rs` lacks, and with those that it has without need.
fn compare<T: PartialEq>(what: &str, found: &[T], known: &[T], line: impl Fn(&T) -> String) {
    let lines = |of: &[T], without: &[T]| -> String {
        of.iter().filter(|entry| !without.contains(entry)).map(|entry| format!("\n    {},", line(entry))).collect()
    };
    let (new, gone) = (lines(found, known), lines(known, found));
    assert!(new.is_empty(), "{what}, not in tests/layering/known.rs:{new}\nto be taken out there:{gone}");
    assert!(gone.is_empty(), "{what}: to be taken out of tests/layering/known.rs:{gone}");
}

#[test]
fn no_circle_of_files() {
    let sources = all_sources();
    let mut found = Vec::new();
    for folder in CRATES {
        let files = Crate::new(folder, &sources);
        let edges = files.edges();
        for circle in circles::circles(&files) {
            println!("circle of files:");
            for path in &circle {
                let used: Vec<&String> = edges[path].iter().filter(|target| circle.contains(target)).collect();
                println!("    {path} uses {used:?}");
            }
            found.push(circle);
        }
    }
    let known: Vec<Vec<String>> =
        known::CIRCLES.iter().map(|circle| circle.iter().map(|path| (*path).to_owned()).collect()).collect();
    compare("circles of files", &found, &known, |circle| format!("&{circle:?}"));
}

/// Files that may look into JSON by strings: the machinery of specs, the readers of formats, and the writer of the document.
const READERS_OF_JSON: [&str; 5] =
    ["src/spec/", "src/scene.rs", "src/scenes.rs", "jobs/src/verify/case.rs", "api/src/openapi/completion.rs"];

/// Look-ups in JSON by strings: `value["name"]`, `value.get("name")`, `value.pointer(…)`. Columns of SQL rows are none.
fn json_lookups(text: &str) -> usize {
    let production = text.split("#[cfg(test)]").next().unwrap_or_default();
    let follows_value = |at: usize| production[..at].ends_with(|c: char| c.is_alphanumeric() || c == ')' || c == ']');
    let is_name = |at: usize| production[at..].starts_with(|c: char| c.is_ascii_lowercase());
    let indexed = production.match_indices("[\"").filter(|(at, _)| follows_value(*at) && is_name(*at + 2)).count();
    let gets = production
        .match_indices(".get(\"")
        .filter(|(at, _)| is_name(*at + 6) && !production[..*at].ends_with("row"))
        .count();
    indexed + gets + production.matches(".pointer(").count()
}

#[test]
fn nothing_below_the_specs_looks_into_json_by_strings() {
    let mut found = String::new();
    for (path, text) in all_sources() {
        let is_reader = READERS_OF_JSON.iter().any(|reader| path.starts_with(reader)) || path.ends_with("tests.rs");
        let count = json_lookups(&text);
        if !is_reader && count > 0 {
            found.push_str(&format!("\n    {path}: {count}"));
        }
    }
    assert!(found.is_empty(), "look-ups in JSON by strings in:{found}");
}

/// Words for people. Particles, cells, files and processes are called by their nouns.
const BANNED_WORDS: [&str; 5] = ["who", "whoever", "nobody", "somebody", "everybody"];

#[test]
fn things_are_not_called_like_people() {
    let mut excess = String::new();
    let mut fewer = String::new();
    for (path, text) in all_sources() {
        let words = text.split(|c: char| !c.is_alphanumeric());
        let count = words.filter(|word| BANNED_WORDS.contains(&word.to_lowercase().as_str())).count();
        let known = known::WORDS.iter().find(|(file, _)| *file == path).map_or(0, |(_, count)| *count);
        let list = if count > known { &mut excess } else { &mut fewer };
        if count != known {
            list.push_str(&format!("\n    (\"{path}\", {count}),"));
        }
    }
    // The list may be shortened now; a file with fewer words than it allows is no fault.
    println!("fewer words than tests/layering/known.rs allows:{fewer}");
    assert!(excess.is_empty(), "{BANNED_WORDS:?} stand for things in:{excess}");
}

/// Lines of a function above which it needs a reason.
const LONG_FUNCTION: usize = 60;

#[test]
fn a_function_over_60_lines_has_a_reason() {
    let mut found = Vec::new();
    for (path, text) in all_sources().iter().filter(|(path, _)| !is_test_file(path)) {
        let long = functions::functions(text).into_iter().filter(|(_, lines)| *lines > LONG_FUNCTION);
        found.extend(long.map(|(name, lines)| (path.clone(), name, lines)));
    }
    let known: Vec<(String, String, usize)> = known::LONG_FUNCTIONS
        .iter()
        .map(|(path, name, lines, _)| ((*path).to_owned(), (*name).to_owned(), *lines))
        .collect();
    let line = |(path, name, lines): &(String, String, usize)| format!("({path:?}, {name:?}, {lines}, \"…\")");
    compare("functions over 60 lines", &found, &known, line);
    assert!(known::LONG_FUNCTIONS.iter().all(|(_, _, _, reason)| reason.len() > 10));
}

/// Lines of a file above which it needs a reason: a smell, not a limit. One type is not cut into several files for it.
const LONG_FILE: usize = 500;

#[test]
fn a_file_over_500_lines_has_a_reason() {
    let long = all_sources().into_iter().filter(|(_, text)| text.lines().count() > LONG_FILE);
    let found: Vec<String> = long.map(|(path, _)| path).collect();
    let known: Vec<String> = known::LONG_FILES.iter().map(|(path, _)| (*path).to_owned()).collect();
    compare("files over 500 lines", &found, &known, |path| format!("({path:?}, \"…\")"));
    assert!(known::LONG_FILES.iter().all(|(_, reason)| reason.len() > 10));
}
