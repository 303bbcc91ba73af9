//! Tickets: read access for a minute, for event streams and downloads where no header can be sent.

use super::Client;
use meniscus_jobs::system::digest;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time that a ticket is good for.
pub const LIFETIME: Duration = Duration::from_secs(60);
/// Tickets that are good at the same time, at most; the oldest go first.
const MOST: usize = 10_000;

/// The tickets that are good now. They are kept in memory alone.
#[derive(Debug, Clone, Default)]
pub struct Tickets(Arc<Mutex<HashMap<String, (Client, Instant)>>>);

impl Tickets {
    /// Makes a ticket for a client.
    ///
    /// # Errors
    /// When the system has no random numbers.
    pub fn issue(&self, client: &Client) -> std::io::Result<String> {
        let ticket = format!("mnt_{}", crate::access::secret()?);
        let mut tickets = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        tickets.retain(|_, (_, made)| made.elapsed() < LIFETIME);
        if tickets.len() >= MOST
            && let Some(oldest) = tickets.iter().min_by_key(|(_, (_, made))| *made).map(|(digest, _)| digest.clone())
        {
            tickets.remove(&oldest);
        }
        tickets.insert(digest::of_bytes(ticket.as_bytes()), (client.clone(), Instant::now()));
        Ok(ticket)
    }

    /// The client whose ticket this is; None where it is unknown or too old.
    #[must_use]
    pub fn client(&self, ticket: &str) -> Option<Client> {
        let tickets = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let (client, made) = tickets.get(&digest::of_bytes(ticket.as_bytes()))?;
        (made.elapsed() < LIFETIME).then(|| client.clone())
    }
}

/// Whether a path is one that a ticket opens: events, files and content.
#[must_use]
pub fn opens(path: &str) -> bool {
    path.ends_with("/events") || path.ends_with("/content") || path.ends_with("/files.tar") || path.contains("/files/")
}

#[cfg(test)]
mod tests {
    use super::{Tickets, opens};
    use crate::access::Client;

    #[test]
    fn a_ticket_is_known_and_opens_what_needs_it() {
        let tickets = Tickets::default();
        let client = Client { name: "alice".to_owned(), is_admin: false };
        let ticket = tickets.issue(&client).unwrap();
        assert_eq!(tickets.client(&ticket), Some(client));
        assert_eq!(tickets.client("mnt_other"), None);
        assert!(opens("/v1/jobs/job_1/events") && opens("/v1/jobs/job_1/files/frames/000000.vtkhdf"));
        assert!(!opens("/v1/jobs") && !opens("/v1/jobs/job_1"));
    }
}
