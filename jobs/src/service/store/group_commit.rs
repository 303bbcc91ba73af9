//! Group commit: a thread of its own takes all small transactions that wait and makes them durable by one commit. Each of
//! them has a savepoint of its own, so that a failure of one undoes nothing of the others.

use super::{Made, Store, StoreError};
use rusqlite::{Connection, Transaction, TransactionBehavior};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::watch;

/// Work in a transaction that is shared with other work.
pub(super) type SharedWork = Box<dyn FnOnce(&Transaction) -> Result<Made, StoreError> + Send>;

/// Work that waits for the writer, and the channel on which its caller waits.
pub(super) struct Waiting {
    work: SharedWork,
    reply: SyncSender<Result<Made, StoreError>>,
}

/// Most transactions in one commit.
const MOST_AT_ONCE: usize = 256;

/// Starts the thread; it ends when the sender is dropped.
pub(super) fn start(
    writer: Arc<Mutex<Connection>>,
    changes: watch::Sender<u64>,
) -> std::io::Result<Mutex<Sender<Waiting>>> {
    let (sender, receiver) = channel();
    std::thread::Builder::new().name("committer".to_owned()).spawn(move || commit_all(&writer, &changes, &receiver))?;
    Ok(Mutex::new(sender))
}

fn commit_all(writer: &Mutex<Connection>, changes: &watch::Sender<u64>, receiver: &Receiver<Waiting>) {
    while let Ok(first) = receiver.recv() {
        let mut connection = writer.lock().unwrap_or_else(PoisonError::into_inner);
        // Requests that queued while the writer was busy join this commit.
        let all: Vec<Waiting> = std::iter::once(first).chain(receiver.try_iter().take(MOST_AT_ONCE)).collect();
        let mut done = Vec::with_capacity(all.len());
        let mut waiting = all.into_iter();
        let begun = connection.transaction_with_behavior(TransactionBehavior::Immediate).map_err(StoreError::from);
        let committed = begun.and_then(|transaction| {
            for Waiting { work, reply } in waiting.by_ref() {
                done.push((in_savepoint(&transaction, work), reply));
                // A full disk can roll everything back in the middle: then nothing more must be begun, or it would be
                // committed by itself.
                if transaction.is_autocommit() {
                    return Err(StoreError::GroupCommit("rolled back: database or disk is full".to_owned()));
                }
            }
            Ok(transaction.commit()?)
        });
        drop(connection);
        match committed {
            Ok(()) => {
                changes.send_modify(|count| *count += 1);
                for (result, reply) in done {
                    // A caller that has gone does not need the result.
                    let _ = reply.send(result);
                }
            }
            Err(error) => {
                let all = done.into_iter().map(|(_, reply)| reply).chain(waiting.map(|one| one.reply));
                for reply in all {
                    let _ = reply.send(Err(StoreError::GroupCommit(error.to_string())));
                }
            }
        }
    }
}

fn in_savepoint(transaction: &Transaction, work: SharedWork) -> Result<Made, StoreError> {
    transaction.execute_batch("SAVEPOINT one")?;
    // A panic in one must not undo the others or end this thread.
    let result = catch_unwind(AssertUnwindSafe(|| work(transaction)))
        .unwrap_or_else(|_| Err(StoreError::GroupCommit("a transaction panicked".to_owned())));
    let end = if result.is_ok() { "RELEASE one" } else { "ROLLBACK TO one; RELEASE one" };
    match transaction.execute_batch(end) {
        Err(error) if result.is_ok() => Err(error.into()),
        _ => result,
    }
}

impl Store {
    /// Runs work in a shared transaction; it is durable when this returns.
    pub(super) fn write_in_group(&self, work: SharedWork) -> Result<Made, StoreError> {
        let (reply, answer) = sync_channel(1);
        let gone = || StoreError::GroupCommit("the committing thread has ended".to_owned());
        let sender = self.waiting.lock().unwrap_or_else(PoisonError::into_inner).clone();
        sender.send(Waiting { work, reply }).map_err(|_| gone())?;
        answer.recv().map_err(|_| gone())?
    }
}
