//! Lists the verification cases and bad runs of `tests/validation` with their text, so that the program has them without a repository.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let mut text = String::new();
    for (name, folder) in [("FILES", "cases"), ("BAD_FILES", "bad")] {
        let root = variable("CARGO_MANIFEST_DIR")?.join("../tests/validation").join(folder);
        println!("cargo:rerun-if-changed={}", root.display());
        list(name, &root, &mut text)?;
    }
    fs::write(variable("OUT_DIR")?.join("verification_cases.rs"), text)
}

/// Writes a table of the files below a directory.
fn list(name: &str, root: &Path, text: &mut String) -> io::Result<()> {
    let mut files = Vec::new();
    collect(root, &mut files)?;
    files.sort();
    // Writing to a String cannot fail.
    let _ = writeln!(text, "pub static {name}: &[(&str, &str)] = &[");
    for file in &files {
        let name = file.strip_prefix(root).map_err(io::Error::other)?;
        let _ =
            writeln!(text, "    ({:?}, include_str!({:?})),", name.display().to_string(), file.display().to_string());
    }
    text.push_str("];\n");
    Ok(())
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
