//! A tar archive as a stream. A reader that stalls holds a task and a file, but no thread.

use axum::body::Bytes;
use std::io;
use std::path::PathBuf;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio::io::AsyncReadExt;
use tokio::sync::mpsc;

/// Size of the blocks of a tar archive.
const BLOCK: u64 = 512;
/// Bytes that are read at once.
const CHUNK: usize = 1 << 16;

/// Content of an entry.
#[derive(Debug, Clone)]
pub enum Content {
    /// A file on the disk.
    File(PathBuf),
    /// A text in memory.
    Text(String),
}

/// An entry of an archive.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Path in the archive.
    pub name: String,
    /// Its content.
    pub content: Content,
}

/// Where the pieces of an archive go.
pub type Sink = mpsc::Sender<Result<Bytes, io::Error>>;

/// Sends an archive piece by piece, until its reader goes away.
pub async fn send(entries: Vec<Entry>, sink: Sink) {
    if let Err(error) = send_all(entries, &sink).await {
        // The broken stream tells the client that the archive is incomplete.
        let _ = sink.send(Err(error)).await;
    }
}

async fn send_all(entries: Vec<Entry>, sink: &Sink) -> io::Result<()> {
    let mut newest = UNIX_EPOCH;
    for Entry { name, content } in entries {
        match content {
            Content::File(path) => {
                let file = tokio::fs::File::open(path).await?;
                let meta = file.metadata().await?;
                let changed = meta.modified().unwrap_or(UNIX_EPOCH);
                newest = newest.max(changed);
                put(sink, header(&name, meta.len(), changed)?).await?;
                send_file(file, meta.len(), sink).await?;
            }
            Content::Text(text) => {
                // It was made of files that were written before.
                let changed = if newest == UNIX_EPOCH { SystemTime::now() } else { newest };
                put(sink, header(&name, text.len() as u64, changed)?).await?;
                let length = text.len() as u64;
                put(sink, text.into()).await?;
                put(sink, padding(length)).await?;
            }
        }
    }
    put(sink, vec![0; 2 * BLOCK as usize].into()).await
}

async fn send_file(file: tokio::fs::File, length: u64, sink: &Sink) -> io::Result<()> {
    let mut file = file.take(length);
    let mut sent = 0;
    loop {
        let mut chunk = Vec::with_capacity(CHUNK);
        if file.read_buf(&mut chunk).await? == 0 {
            break;
        }
        sent += chunk.len() as u64;
        put(sink, chunk.into()).await?;
    }
    if sent != length {
        return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "a file became shorter"));
    }
    put(sink, padding(length)).await
}

/// Zeros up to the next block.
fn padding(length: u64) -> Bytes {
    vec![0; (length.next_multiple_of(BLOCK) - length) as usize].into()
}

fn header(name: &str, length: u64, changed: SystemTime) -> io::Result<Bytes> {
    let mut header = tar::Header::new_ustar();
    header.set_path(name)?;
    header.set_size(length);
    header.set_mode(0o644);
    header.set_mtime(changed.duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO).as_secs());
    header.set_cksum();
    Ok(Bytes::copy_from_slice(header.as_bytes()))
}

async fn put(sink: &Sink, bytes: Bytes) -> io::Result<()> {
    if bytes.is_empty() {
        return Ok(());
    }
    sink.send(Ok(bytes)).await.map_err(|_| io::Error::from(io::ErrorKind::BrokenPipe))
}

#[cfg(test)]
mod tests {
    use super::{Content, Entry, send};
    use std::io::Read;
    use tokio::sync::mpsc;

    #[tokio::test]
    async fn other_programs_read_what_is_sent() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("file");
        std::fs::write(&path, vec![7; 100_000]).unwrap();
        let entry = |name: &str, content| Entry { name: name.to_owned(), content };
        let entries = vec![
            entry("job/frames/a", Content::File(path)),
            entry("job/index", Content::Text("{}".to_owned())),
            entry("job/empty", Content::Text(String::new())),
        ];
        let (sender, mut receiver) = mpsc::channel(2);
        let sending = tokio::spawn(send(entries, sender));
        let mut bytes = Vec::new();
        while let Some(piece) = receiver.recv().await {
            bytes.extend_from_slice(&piece.unwrap());
        }
        sending.await.unwrap();
        let mut archive = tar::Archive::new(bytes.as_slice());
        let mut found = Vec::new();
        for entry in archive.entries().unwrap() {
            let mut entry = entry.unwrap();
            let mut content = Vec::new();
            entry.read_to_end(&mut content).unwrap();
            assert!(entry.header().mtime().unwrap() > 1_700_000_000);
            found.push((entry.path().unwrap().display().to_string(), content.len()));
        }
        let expected = [("job/frames/a", 100_000), ("job/index", 2), ("job/empty", 0)];
        assert_eq!(found, expected.map(|(name, length)| (name.to_owned(), length)));
    }
}
