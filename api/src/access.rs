//! Who may do what: tokens with scopes, the names under which the service answers, and how much one client may make.

use crate::application::Application;
use crate::error::ApiError;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use meniscus_jobs::system::digest;
use std::collections::{BTreeSet, HashMap};
use std::net::IpAddr;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// What a token allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scope {
    /// Reading everything.
    Read,
    /// Making jobs, studies, uploads, estimates.
    Submit,
    /// Cancel, pause, resume, delete, checkpoints on demand.
    Control,
}

impl Scope {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Read, Self::Submit, Self::Control];

    /// The word that stands for it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Submit => "submit",
            Self::Control => "control",
        }
    }

    /// Scopes with commas between.
    #[must_use]
    pub fn parse_list(text: &str) -> Option<BTreeSet<Self>> {
        text.split(',').map(|word| Self::ALL.into_iter().find(|scope| scope.word() == word.trim())).collect()
    }
}

#[derive(Debug, Clone)]
struct Token {
    name: String,
    scopes: BTreeSet<Scope>,
    sha256: String,
}

/// Who a request comes from; its name keeps idempotency keys and quotas apart.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Client(pub String);

/// A token file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TokenFileError {
    /// It cannot be read.
    #[error("the token file cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// A line is no token.
    #[error("line {0} of the token file is not NAME SCOPES sha256:DIGEST with scopes among read, submit, control")]
    Line(usize),
    /// Two lines have one name.
    #[error("the token file has two tokens of the name {0}")]
    Twice(String),
    /// There is none in it.
    #[error("the token file has no token")]
    Empty,
}

/// The rules of a service.
#[derive(Debug, Clone)]
pub struct AccessRules {
    tokens: Vec<Token>,
    hosts: BTreeSet<String>,
    per_minute: Option<u32>,
    buckets: Arc<Mutex<HashMap<String, Bucket>>>,
}

/// What a client may still make.
#[derive(Debug, Clone, Copy)]
struct Bucket {
    left: f64,
    since: Instant,
}

/// What a client may still make in this minute.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Budget {
    /// A minute's worth.
    pub quota: u32,
    /// What is left.
    pub left: u32,
    /// Seconds until there is one more.
    pub next_s: u64,
}

impl AccessRules {
    /// From the operator's choices.
    ///
    /// # Errors
    /// [`TokenFileError`].
    pub fn new(
        token_file: Option<&Path>,
        hosts: &[String],
        bind: IpAddr,
        per_minute: Option<u32>,
    ) -> Result<Self, TokenFileError> {
        let tokens = token_file.map(|path| parse_tokens(&std::fs::read_to_string(path)?)).transpose()?;
        let own = ["localhost".to_owned(), "127.0.0.1".to_owned(), "[::1]".to_owned(), bracketed(bind)];
        let hosts = own.into_iter().chain(hosts.iter().map(|host| host.to_ascii_lowercase())).collect();
        Ok(Self { tokens: tokens.unwrap_or_default(), hosts, per_minute, buckets: Arc::default() })
    }

    /// Whether requests need a token.
    #[must_use]
    pub fn has_tokens(&self) -> bool {
        !self.tokens.is_empty()
    }

    /// Whether the service answers under the name in a `Host` header, whatever its port. This keeps pages of other
    /// origins, whose names can be made to point here, out of a browser's reach.
    fn knows_host(&self, host: &str) -> bool {
        let name = match host.rfind(':') {
            Some(colon) if !host.ends_with(']') => &host[..colon],
            _ => host,
        };
        self.hosts.contains(&name.to_ascii_lowercase())
    }

    fn client(&self, headers: &HeaderMap, wanted: Scope) -> Result<Client, ApiError> {
        if self.tokens.is_empty() {
            return Ok(Client::default());
        }
        let given = headers.get(header::AUTHORIZATION).and_then(|v| v.to_str().ok());
        let Some((scheme, token)) = given.and_then(|text| text.split_once(' ')) else {
            return Err(ApiError::Unauthorized);
        };
        if !scheme.eq_ignore_ascii_case("bearer") {
            return Err(ApiError::Unauthorized);
        }
        // Digests are compared: how long that takes tells nothing about a token.
        let sha256 = digest::of_bytes(token.trim().as_bytes());
        let token = self.tokens.iter().find(|known| known.sha256 == sha256).ok_or(ApiError::Unauthorized)?;
        if token.scopes.contains(&wanted) { Ok(Client(token.name.clone())) } else { Err(ApiError::Forbidden(wanted)) }
    }

    /// Takes one creation from a client's budget; None where there is no limit.
    ///
    /// # Errors
    /// The budget, when nothing is left of it.
    pub fn spend(&self, client: &Client) -> Result<Option<Budget>, Budget> {
        let Some(quota) = self.per_minute else { return Ok(None) };
        let rate = f64::from(quota) / 60.0;
        let mut buckets = self.buckets.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Instant::now();
        let bucket = buckets.entry(client.0.clone()).or_insert(Bucket { left: f64::from(quota), since: now });
        bucket.left = (bucket.left + rate * bucket.since.elapsed().as_secs_f64()).min(f64::from(quota));
        bucket.since = now;
        let is_there = bucket.left >= 1.0;
        if is_there {
            bucket.left -= 1.0;
        }
        let next_s = ((1.0 - bucket.left.fract()) / rate).ceil().max(1.0) as u64;
        let budget = Budget { quota, left: bucket.left as u32, next_s };
        if is_there { Ok(Some(budget)) } else { Err(budget) }
    }
}

fn bracketed(ip: IpAddr) -> String {
    if ip.is_ipv6() { format!("[{ip}]") } else { ip.to_string() }
}

fn parse_tokens(text: &str) -> Result<Vec<Token>, TokenFileError> {
    let mut tokens: Vec<Token> = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        let parsed = match words.as_slice() {
            [name, scopes, sha256] => sha256
                .strip_prefix("sha256:")
                .filter(|hex| hex.len() == 64 && hex.bytes().all(|b| b.is_ascii_hexdigit()))
                .zip(Scope::parse_list(scopes))
                .map(|(hex, scopes)| Token { name: (*name).to_owned(), scopes, sha256: hex.to_ascii_lowercase() }),
            _ => None,
        };
        let token = parsed.ok_or(TokenFileError::Line(k + 1))?;
        if tokens.iter().any(|other| other.name == token.name) {
            return Err(TokenFileError::Twice(token.name));
        }
        tokens.push(token);
    }
    if tokens.is_empty() { Err(TokenFileError::Empty) } else { Ok(tokens) }
}

/// The scope that a request needs; None where anybody may.
fn wanted_scope(method: &Method, path: &str) -> Option<Scope> {
    if path == "/healthz" || path == "/readyz" {
        return None;
    }
    let makes = ["/v1/jobs", "/v1/studies", "/v1/uploads", "/v1/estimates"].contains(&path) || path.ends_with("/retry");
    match *method {
        Method::GET | Method::HEAD => Some(Scope::Read),
        Method::POST if makes => Some(Scope::Submit),
        _ => Some(Scope::Control),
    }
}

/// Turns away requests to other names and without the right token.
pub async fn guard(State(application): State<Application>, mut request: Request, next: Next) -> Response {
    let rules = &application.config.access;
    let named = request.headers().get(header::HOST).and_then(|v| v.to_str().ok());
    // HTTP/1.1 always names a host; a request line may name it instead.
    let named = request.uri().authority().map(axum::http::uri::Authority::as_str).or(named);
    if !named.is_some_and(|host| rules.knows_host(host)) {
        return ApiError::UnknownHost.into_response();
    }
    // A page of elsewhere must not make jobs through somebody's browser.
    let origin = request.headers().get(header::ORIGIN).and_then(|v| v.to_str().ok());
    if origin.is_some_and(|origin| !origin.split_once("://").is_some_and(|(_, host)| rules.knows_host(host))) {
        return ApiError::ForeignOrigin.into_response();
    }
    let client = match wanted_scope(request.method(), request.uri().path()) {
        None => Ok(Client::default()),
        Some(scope) => rules.client(request.headers(), scope),
    };
    match client {
        Ok(client) => {
            request.extensions_mut().insert(client);
            next.run(request).await
        }
        Err(error) => error.into_response(),
    }
}

impl Budget {
    /// As `RateLimit` and `RateLimit-Policy`.
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
    use super::{AccessRules, Client, Scope, parse_tokens, wanted_scope};
    use axum::http::{HeaderMap, HeaderValue, Method};
    use meniscus_jobs::system::digest;

    fn rules(per_minute: Option<u32>) -> AccessRules {
        let line = |name: &str, scopes: &str| format!("{name} {scopes} sha256:{}\n", digest::of_bytes(name.as_bytes()));
        let mut rules = AccessRules::new(None, &["Sim.Example".into()], [10, 0, 0, 1].into(), per_minute).unwrap();
        rules.tokens = parse_tokens(&(line("alice", "read,submit") + "# nobody\n\n" + &line("bob", "read"))).unwrap();
        rules
    }

    #[test]
    fn tokens_open_what_their_scopes_say() {
        let rules = rules(None);
        let with = |text: &'static str| {
            HeaderMap::from_iter([("authorization".parse().unwrap(), HeaderValue::from_static(text))])
        };
        assert_eq!(rules.client(&with("Bearer alice"), Scope::Submit).unwrap(), Client("alice".into()));
        for (text, scope) in [
            ("Bearer bob", Scope::Submit),
            ("Bearer eve", Scope::Read),
            ("Basic alice", Scope::Read),
            ("Bearer", Scope::Read),
        ] {
            assert!(rules.client(&with(text), scope).is_err(), "{text}");
        }
        assert!(rules.client(&HeaderMap::new(), Scope::Read).is_err());
        for text in ["a read", "a fly sha256:00", "a read sha256:0", ""] {
            assert!(parse_tokens(text).is_err(), "{text}");
        }
    }

    #[test]
    fn only_known_names_are_answered() {
        let rules = rules(None);
        for host in ["localhost", "LOCALHOST:99", "127.0.0.1:1", "[::1]:80", "[::1]", "sim.example:443", "10.0.0.1"] {
            assert!(rules.knows_host(host), "{host}");
        }
        for host in ["evil.example", "localhost.evil.example:80", "", "10.0.0.2", "[::2]:80"] {
            assert!(!rules.knows_host(host), "{host}");
        }
    }

    #[test]
    fn a_budget_is_spent_and_comes_back() {
        let rules = rules(Some(3));
        let (a, b) = (Client("a".into()), Client("b".into()));
        let left: Vec<Option<u32>> = (0..4).map(|_| rules.spend(&a).ok().flatten().map(|budget| budget.left)).collect();
        assert_eq!(left, [Some(2), Some(1), Some(0), None]);
        assert!(rules.spend(&b).is_ok());
        assert_eq!(rules.spend(&a).unwrap_err().next_s, 20);
    }

    #[test]
    fn every_path_has_its_scope() {
        for (method, path, scope) in [
            (Method::GET, "/healthz", None),
            (Method::GET, "/metrics", Some(Scope::Read)),
            (Method::POST, "/v1/jobs", Some(Scope::Submit)),
            (Method::POST, "/v1/studies/std_1/retry", Some(Scope::Submit)),
            (Method::POST, "/v1/jobs/job_1/cancel", Some(Scope::Control)),
            (Method::DELETE, "/v1/uploads/upl_1", Some(Scope::Control)),
            (Method::POST, "/v1/jobs/job_1/checkpoints", Some(Scope::Control)),
        ] {
            assert_eq!(wanted_scope(&method, path), scope, "{method} {path}");
        }
    }
}
