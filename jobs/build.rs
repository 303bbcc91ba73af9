//! Lists the verification cases of `tests/validation/cases` with their text, so that the program has them without a repository.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let root = variable("CARGO_MANIFEST_DIR")?.join("../tests/validation/cases");
    println!("cargo:rerun-if-changed={}", root.display());
    let mut files = Vec::new();
    collect(&root, &mut files)?;
    files.sort();
    let mut text = String::from("pub static FILES: &[(&str, &str)] = &[\n");
    for file in &files {
        let name = file.strip_prefix(&root).map_err(io::Error::other)?;
        // Writing to a String cannot fail.
        let _ =
            writeln!(text, "    ({:?}, include_str!({:?})),", name.display().to_string(), file.display().to_string());
    }
    text.push_str("];\n");
    fs::write(variable("OUT_DIR")?.join("verification_cases.rs"), text)
}

/// A path that cargo hands to build scripts. At run time, so that a script built in another folder serves this one too.
fn variable(name: &str) -> io::Result<PathBuf> {
    let value = env::var_os(name).ok_or_else(|| io::Error::other(format!("cargo sets {name}")))?;
    Ok(PathBuf::from(value))
}

fn collect(directory: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(directory)? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else if path.extension().is_some_and(|extension| extension == "json") {
            files.push(path);
        }
    }
    Ok(())
}
