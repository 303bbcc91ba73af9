//! Operators as files: Matrix Market text, or an archive of NumPy arrays as `scipy.sparse.load_npz` reads it.

use crate::spec::run_options::OperatorFormat;
use crate::system::artifacts;
use meniscus::linear_algebra::SparseRows;
use meniscus::parallel::Interrupt;
use meniscus::simulation::NamedOperator;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Media type of an archive of NumPy arrays.
const NPZ: &str = "application/x-npz";
/// Media type of a Matrix Market file.
const MATRIX_MARKET: &str = "text/plain";

/// Writes an operator into a directory; names and media types of the files.
///
/// # Errors
/// Whatever keeps the files from being written.
pub fn write(
    directory: &Path,
    operator: &NamedOperator,
    format: OperatorFormat,
    interrupt: &Interrupt,
) -> io::Result<Vec<(String, &'static str)>> {
    let NamedOperator { name, rows, areas } = operator;
    let mut written = Vec::new();
    match format {
        OperatorFormat::MatrixMarket => {
            let file = format!("{name}.mtx");
            into_file(directory, &file, interrupt, |out| matrix(out, rows))?;
            written.push((file, MATRIX_MARKET));
            if let Some(areas) = areas {
                let file = format!("{name}_areas.mtx");
                into_file(directory, &file, interrupt, |out| column(out, areas))?;
                written.push((file, MATRIX_MARKET));
            }
        }
        OperatorFormat::Npz => {
            let file = format!("{name}.npz");
            into_file(directory, &file, interrupt, |out| archive(out, rows, *areas))?;
            written.push((file, NPZ));
        }
    }
    Ok(written)
}

/// Bytes between two looks at the interrupt.
const BUFFER_BYTES: usize = 1 << 18;

/// A buffered file that a request can cut short.
type Output = BufWriter<Interruptible>;

/// A file whose writing fails once the interrupt is raised.
struct Interruptible {
    file: std::fs::File,
    interrupt: Interrupt,
}

impl Write for Interruptible {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.interrupt.check().map_err(io::Error::other)?;
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Interruptible {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Writes a file that appears under its name when it is complete.
fn into_file(
    directory: &Path,
    name: &str,
    interrupt: &Interrupt,
    fill: impl FnOnce(&mut Output) -> io::Result<()>,
) -> io::Result<()> {
    let path = directory.join(name);
    let file = std::fs::File::create(artifacts::unfinished(&path))?;
    let mut out = BufWriter::with_capacity(BUFFER_BYTES, Interruptible { file, interrupt: interrupt.clone() });
    fill(&mut out)?;
    out.flush()?;
    artifacts::finish(&path)
}

/// Rows and columns count from one; numbers read back to the last bit.
fn matrix(out: &mut impl Write, rows: &SparseRows) -> io::Result<()> {
    let size = rows.rows();
    writeln!(out, "%%MatrixMarket matrix coordinate real general\n{size} {size} {}", rows.entries())?;
    for i in 0..size {
        let (columns, weights) = rows.row(i);
        for (j, weight) in columns.iter().zip(weights) {
            writeln!(out, "{} {} {weight:e}", i + 1, j + 1)?;
        }
    }
    Ok(())
}

fn column(out: &mut impl Write, values: &[f64]) -> io::Result<()> {
    writeln!(out, "%%MatrixMarket matrix array real general\n{} 1", values.len())?;
    values.iter().try_for_each(|value| writeln!(out, "{value:e}"))
}

/// Compressed rows: `data`, `indices`, `indptr`, `shape`, `format`; and `areas`.
fn archive(out: &mut Output, rows: &SparseRows, areas: Option<&[f64]>) -> io::Result<()> {
    let size = rows.rows();
    let mut archive = ZipWriter::new(out);
    let row = |i: usize| rows.row(i);
    let count = rows.entries();
    array(&mut archive, "data", "<f8", &count.to_string(), |out| {
        (0..size).flat_map(|i| row(i).1).try_for_each(|w| out.write_all(&w.to_le_bytes()))
    })?;
    array(&mut archive, "indices", "<i8", &count.to_string(), |out| {
        (0..size).flat_map(|i| row(i).0).try_for_each(|j| out.write_all(&i64::from(*j).to_le_bytes()))
    })?;
    array(&mut archive, "indptr", "<i8", &(size + 1).to_string(), |out| {
        let mut start = 0_i64;
        out.write_all(&start.to_le_bytes())?;
        (0..size).try_for_each(|i| {
            start += row(i).0.len() as i64;
            out.write_all(&start.to_le_bytes())
        })
    })?;
    array(&mut archive, "shape", "<i8", "2", |out| {
        (0..2).try_for_each(|_| out.write_all(&(size as i64).to_le_bytes()))
    })?;
    array(&mut archive, "format", "|S3", "", |out| out.write_all(b"csr"))?;
    if let Some(areas) = areas {
        array(&mut archive, "areas", "<f8", &areas.len().to_string(), |out| {
            areas.iter().try_for_each(|area| out.write_all(&area.to_le_bytes()))
        })?;
    }
    archive.finish().map(|_| ()).map_err(io::Error::other)
}

/// One array in the format `.npy` 1.0: a line that says what follows, padded to a multiple of 64 bytes, then numbers.
fn array<W: Write + Seek>(
    archive: &mut ZipWriter<W>,
    name: &str,
    kind: &str,
    length: &str,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored).large_file(true);
    archive.start_file(format!("{name}.npy"), options).map_err(io::Error::other)?;
    let shape = if length.is_empty() { "()".to_owned() } else { format!("({length},)") };
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    archive.write_all(b"\x93NUMPY\x01\x00")?;
    archive.write_all(&(header.len() as u16).to_le_bytes())?;
    archive.write_all(header.as_bytes())?;
    let mut out = BufWriter::new(archive);
    fill(&mut out)?;
    out.flush()
}

#[cfg(test)]
mod tests {
    use super::Interrupt;
    use super::{NamedOperator, OperatorFormat, SparseRows, write};

    #[test]
    fn a_matrix_is_written_row_by_row() {
        let mut rows = SparseRows::default();
        rows.push_row(&[0, 1], &[-0.1, 0.1]);
        rows.push_row(&[1], &[2e-17]);
        let operator = NamedOperator { name: "test", rows: &rows, areas: Some(&[0.5, 1.5]) };
        let directory = tempfile::tempdir().unwrap();
        let files = write(directory.path(), &operator, OperatorFormat::MatrixMarket, &Interrupt::default()).unwrap();
        let text = |k: usize| std::fs::read_to_string(directory.path().join(&files[k].0)).unwrap();
        assert_eq!(text(0), "%%MatrixMarket matrix coordinate real general\n2 2 3\n1 1 -1e-1\n1 2 1e-1\n2 2 2e-17\n");
        assert_eq!(text(1), "%%MatrixMarket matrix array real general\n2 1\n5e-1\n1.5e0\n");
    }

    /// The same operator gives the same bytes, so that digests compare; every array has its line.
    #[test]
    fn an_archive_is_a_function_of_the_operator() {
        let mut rows = SparseRows::default();
        rows.push_row(&[0], &[1.0]);
        let operator = NamedOperator { name: "test", rows: &rows, areas: Some(&[0.5]) };
        let bytes = || {
            let directory = tempfile::tempdir().unwrap();
            let files = write(directory.path(), &operator, OperatorFormat::Npz, &Interrupt::default()).unwrap();
            assert_eq!(files.len(), 1);
            std::fs::read(directory.path().join("test.npz")).unwrap()
        };
        let found = bytes();
        assert_eq!(found, bytes());
        for line in
            ["'descr': '<f8'", "'shape': (1,)", "'descr': '|S3', 'fortran_order': False, 'shape': ()", "areas.npy"]
        {
            assert!(found.windows(line.len()).any(|part| part == line.as_bytes()), "{line}");
        }
    }
}
