//! Many small transactions as one: those who wait for the writer hand their work to whoever has it, and all become durable
//! by one commit. Each stands in a savepoint of its own, so that one that fails takes nothing of the others away.

use super::{Made, Store, StoreError};
use rusqlite::{Transaction, TransactionBehavior};
use std::sync::PoisonError;
use std::sync::mpsc::{SyncSender, sync_channel};

/// Work in a transaction that others may share.
pub(super) type SharedWork = Box<dyn FnOnce(&Transaction) -> Result<Made, StoreError> + Send>;

/// Work that waits, and who waits for it.
pub(super) struct Waiting {
    work: SharedWork,
    reply: SyncSender<Result<Made, StoreError>>,
}

impl Store {
    /// Runs work together with that of others; it is durable when this returns.
    pub(super) fn write_together(&self, work: SharedWork) -> Result<Made, StoreError> {
        let (reply, answer) = sync_channel(1);
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner).push(Waiting { work, reply });
        let mut connection = self.writer.lock().unwrap_or_else(PoisonError::into_inner);
        let all = std::mem::take(&mut *self.waiting.lock().unwrap_or_else(PoisonError::into_inner));
        // Empty where somebody else had the writer and has done ours.
        if !all.is_empty() {
            let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate);
            let mut done = Vec::with_capacity(all.len());
            let committed = transaction.and_then(|transaction| {
                for Waiting { work, reply } in all {
                    done.push((in_savepoint(&transaction, work), reply));
                }
                transaction.commit()
            });
            drop(connection);
            match committed {
                Ok(()) => {
                    self.changes.send_modify(|count| *count += 1);
                    for (result, reply) in done {
                        // Whoever does not wait any more does not want to know.
                        let _ = reply.send(result);
                    }
                }
                Err(error) => {
                    let text = error.to_string();
                    for (_, reply) in done {
                        let _ = reply.send(Err(StoreError::Together(text.clone())));
                    }
                    return Err(error.into());
                }
            }
        } else {
            drop(connection);
        }
        answer.recv().map_err(|_| StoreError::Together("the transaction was not begun".to_owned()))?
    }
}

fn in_savepoint(transaction: &Transaction, work: SharedWork) -> Result<Made, StoreError> {
    transaction.execute_batch("SAVEPOINT one")?;
    let result = work(transaction);
    let end = if result.is_ok() { "RELEASE one" } else { "ROLLBACK TO one; RELEASE one" };
    transaction.execute_batch(end)?;
    result
}
