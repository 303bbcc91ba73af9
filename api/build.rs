//! Puts the page into the program: the files of `page/dist`, which `make page` bundles, each also compressed. Without them the program
//! has a page that says how to get the real one.

use flate2::Compression;
use flate2::write::GzEncoder;
use sha2::{Digest, Sha256};
use std::env;
use std::fmt::Write as _;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The page of a program that was built without Node.
const SUBSTITUTE: &str = "page/substitute";

fn main() -> io::Result<()> {
    let here = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    let (dist, substitute) = (here.join("page/dist"), here.join(SUBSTITUTE));
    for folder in [&dist, &substitute] {
        println!("cargo::rerun-if-changed={}", folder.display());
    }
    let folder = if dist.join("index.html").is_file() { dist } else { substitute };
    let mut files: Vec<PathBuf> = fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<io::Result<_>>()?;
    files.sort();
    let mut table = String::from("&[\n");
    for file in files {
        let Some(name) = file.file_name().and_then(|name| name.to_str()) else { continue };
        let bytes = fs::read(&file)?;
        let compressed = out.join(format!("{name}.gz"));
        fs::write(&compressed, compress(&bytes)?)?;
        let digest = hex(&Sha256::digest(&bytes));
        let _ = writeln!(
            table,
            "    Asset {{ name: {name:?}, media_type: {:?}, etag: \"\\\"{digest}\\\"\", bytes: include_bytes!({:?}), \
             compressed: include_bytes!({:?}) }},",
            media_type(&file),
            file.display().to_string(),
            compressed.display().to_string(),
        );
    }
    table.push(']');
    fs::write(out.join("page.rs"), table)
}

fn compress(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes)?;
    encoder.finish()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

fn media_type(file: &Path) -> &'static str {
    match file.extension().and_then(|ending| ending.to_str()) {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        _ => "text/plain; charset=utf-8",
    }
}
