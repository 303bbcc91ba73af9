//! Logs on standard error; `MENISCUS_LOG` chooses what (default `info`), `MENISCUS_LOG_FORMAT=json` how.

use tracing_subscriber::EnvFilter;

/// Starts logging. A second call changes nothing.
pub fn start() {
    let filter = EnvFilter::try_from_env("MENISCUS_LOG").unwrap_or_else(|_| EnvFilter::new("info"));
    let builder = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    let json = std::env::var("MENISCUS_LOG_FORMAT").is_ok_and(|format| format == "json");
    // Tests may have set a subscriber of their own.
    let _ = if json { builder.json().try_init() } else { builder.with_ansi(false).try_init() };
}
