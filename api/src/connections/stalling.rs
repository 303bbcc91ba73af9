//! A stream that fails when its peer stalls: while data wait to be written, enough of them must go out in time.

use std::future::Future;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep, sleep_until};

/// Bytes that a peer must take within the time, while there are any for it: a reader of one byte a second is a stalled one.
const LEAST_BYTES: usize = 16 << 10;

/// A stream whose writes fail when the peer takes too little for too long.
pub(super) struct Stalling<S> {
    inner: S,
    time: Duration,
    /// Runs while a write waits.
    deadline: Option<Pin<Box<Sleep>>>,
    /// Bytes that went out since the deadline was set.
    taken: usize,
}

impl<S> Stalling<S> {
    /// A stream whose peer must take some of what waits for it within this time.
    pub(super) fn new(inner: S, time: Duration) -> Self {
        Self { inner, time, deadline: None, taken: 0 }
    }

    /// Notes the outcome of a write.
    fn watch<T>(&mut self, context: &mut Context, written: Poll<io::Result<T>>, bytes: usize) -> Poll<io::Result<T>> {
        match written {
            Poll::Pending => {
                let time = self.time;
                let deadline = self.deadline.get_or_insert_with(|| Box::pin(sleep_until(Instant::now() + time)));
                if deadline.as_mut().poll(context).is_ready() {
                    return Poll::Ready(Err(io::Error::new(io::ErrorKind::TimedOut, "the client does not read")));
                }
                Poll::Pending
            }
            ready => {
                self.taken += bytes;
                if self.taken >= LEAST_BYTES {
                    (self.deadline, self.taken) = (None, 0);
                }
                ready
            }
        }
    }

    /// Everything that waited has gone out.
    fn rest(&mut self) {
        (self.deadline, self.taken) = (None, 0);
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Stalling<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_read(context, buffer)
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Stalling<S> {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.inner).poll_write(context, bytes);
        let count = if let Poll::Ready(Ok(count)) = written { count } else { 0 };
        if count == bytes.len() {
            self.rest();
        }
        self.watch(context, written, count)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::Stalling;
    use std::time::Duration;
    use tokio::io::{AsyncReadExt, AsyncWriteExt, duplex};

    #[tokio::test]
    async fn a_reader_that_stalls_or_crawls_is_given_up_and_a_slow_one_is_not() {
        for (bytes, pause_ms, is_given_up) in [(0, 20, true), (1, 20, true), (4096, 20, false)] {
            let (near, mut far) = duplex(1 << 12);
            let reading = tokio::spawn(async move {
                let mut buffer = vec![0; bytes.max(1)];
                loop {
                    tokio::time::sleep(Duration::from_millis(pause_ms)).await;
                    if bytes > 0 && far.read(&mut buffer).await.is_err() {
                        return;
                    }
                }
            });
            let mut stream = Stalling::new(near, Duration::from_millis(400));
            let written = stream.write_all(&vec![7; 200 << 10]).await;
            assert_eq!(written.is_err(), is_given_up, "{bytes}");
            reading.abort();
        }
    }
}
