//! How much each client may create in a minute: a token bucket for each client name.

use axum::http::{HeaderMap, HeaderName, HeaderValue};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Buckets of all clients. Clones share them.
#[derive(Debug, Clone)]
pub struct RateLimiter {
    /// Creations per minute of each client; None where any number is allowed.
    per_minute: Option<u32>,
    buckets: Arc<Mutex<HashMap<String, Bucket>>>,
}

/// Creations that a client has left, and the time at which they were counted.
#[derive(Debug, Clone, Copy)]
struct Bucket {
    left: f64,
    since: Instant,
}

/// Creations that a client has left in this minute.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Budget {
    /// Creations allowed per minute.
    pub quota: u32,
    /// Creations left.
    pub left: u32,
    /// Seconds until one more is allowed.
    pub next_s: u64,
}

impl RateLimiter {
    /// A limiter that allows so many creations per minute and client; None allows any number.
    #[must_use]
    pub fn new(per_minute: Option<u32>) -> Self {
        Self { per_minute, buckets: Arc::default() }
    }

    /// Takes one creation from a client's budget and returns what remains; None where there is no limit.
    ///
    /// # Errors
    /// The budget, if nothing is left of it.
    pub fn spend(&self, client: &str) -> Result<Option<Budget>, Budget> {
        let Some(quota) = self.per_minute else { return Ok(None) };
        let per_second = f64::from(quota) / 60.0;
        let mut buckets = self.buckets.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Instant::now();
        let bucket = buckets.entry(client.to_owned()).or_insert(Bucket { left: f64::from(quota), since: now });
        bucket.left = (bucket.left + per_second * bucket.since.elapsed().as_secs_f64()).min(f64::from(quota));
        bucket.since = now;
        let is_allowed = bucket.left >= 1.0;
        if is_allowed {
            bucket.left -= 1.0;
        }
        let next_s = ((1.0 - bucket.left.fract()) / per_second).ceil().max(1.0) as u64;
        let budget = Budget { quota, left: bucket.left as u32, next_s };
        if is_allowed { Ok(Some(budget)) } else { Err(budget) }
    }
}

impl Budget {
    /// Adds the headers `RateLimit` and `RateLimit-Policy`.
    pub fn write(self, headers: &mut HeaderMap) {
        let Self { quota, left, next_s } = self;
        let values = [
            ("ratelimit-policy", format!("\"creation\";q={quota};w=60")),
            ("ratelimit", format!("\"creation\";r={left};t={next_s}")),
        ];
        for (name, value) in values {
            if let Ok(value) = HeaderValue::from_str(&value) {
                headers.insert(HeaderName::from_static(name), value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::RateLimiter;

    #[test]
    fn a_budget_is_spent_and_comes_back() {
        let limiter = RateLimiter::new(Some(3));
        let left: Vec<Option<u32>> =
            (0..4).map(|_| limiter.spend("a").ok().flatten().map(|budget| budget.left)).collect();
        assert_eq!(left, [Some(2), Some(1), Some(0), None]);
        assert!(limiter.spend("b").is_ok());
        assert_eq!(limiter.spend("a").unwrap_err().next_s, 20);
        assert_eq!(RateLimiter::new(None).spend("a"), Ok(None));
    }
}
