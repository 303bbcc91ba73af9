//! Access rules: tokens with scopes, and the host names under which the service answers.

use axum::http::{HeaderMap, Method, header};
use meniscus_jobs::system::digest;
use std::collections::BTreeSet;
use std::net::IpAddr;
use std::path::Path;

/// Permission that a token carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scope {
    /// Read all objects and files.
    Read,
    /// Create jobs, studies, uploads and estimates.
    Submit,
    /// Cancel, pause, resume, delete, and request checkpoints.
    Control,
}

impl Scope {
    /// All scopes.
    pub const ALL: [Self; 3] = [Self::Read, Self::Submit, Self::Control];

    /// Name of the scope in token files and headers.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Submit => "submit",
            Self::Control => "control",
        }
    }

    /// Parses names of scopes separated by commas; None if a name is unknown.
    #[must_use]
    pub fn parse_list(text: &str) -> Option<BTreeSet<Self>> {
        text.split(',').map(|word| Self::ALL.into_iter().find(|scope| scope.word() == word.trim())).collect()
    }

    /// The scope that a request needs; None where no token is needed.
    #[must_use]
    pub fn needed(method: &Method, path: &str) -> Option<Self> {
        if path == "/healthz" || path == "/readyz" || path.starts_with("/problems/") {
            return None;
        }
        let creates =
            ["/v1/jobs", "/v1/studies", "/v1/uploads", "/v1/estimates"].contains(&path) || path.ends_with("/retry");
        match *method {
            Method::GET | Method::HEAD => Some(Self::Read),
            Method::POST if creates => Some(Self::Submit),
            _ => Some(Self::Control),
        }
    }
}

#[derive(Debug, Clone)]
struct Token {
    name: String,
    scopes: BTreeSet<Scope>,
    sha256: String,
}

/// Name of the token that a request carries; empty while the service has no tokens. Idempotency keys and budgets are
/// kept apart by it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Client(pub String);

impl Client {
    /// The name as owner of what the client makes; None while the service has no tokens.
    #[must_use]
    pub fn owner(&self) -> Option<String> {
        Some(self.0.clone()).filter(|name| !name.is_empty())
    }
}

/// Why a request is not allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum AccessError {
    /// The request carries no token, or an unknown one.
    #[error("no known token")]
    Unauthorized,
    /// The token lacks this scope.
    #[error("the token lacks the scope {}", .0.word())]
    Forbidden(Scope),
}

/// Why a token file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TokenFileError {
    /// The file cannot be read.
    #[error("the token file cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// A line does not describe a token.
    #[error(
        "line {0} of the token file must be NAME SCOPES sha256:DIGEST, with scopes among read, submit, control; `meniscus token NAME` prints such a line"
    )]
    Line(usize),
    /// Two lines have the same name.
    #[error("the token file has two tokens with the name {0}; names must differ")]
    Twice(String),
    /// The file has no token.
    #[error("the token file has no token; `meniscus token NAME` prints a line for it")]
    Empty,
}

/// Access rules of a service.
#[derive(Debug, Clone)]
pub struct AccessRules {
    tokens: Vec<Token>,
    hosts: BTreeSet<String>,
}

impl AccessRules {
    /// Rules from a token file, additional host names and the address that the service listens on.
    ///
    /// # Errors
    /// [`TokenFileError`].
    pub fn new(token_file: Option<&Path>, hosts: &[String], bind: IpAddr) -> Result<Self, TokenFileError> {
        let tokens = token_file.map(|path| parse_tokens(&std::fs::read_to_string(path)?)).transpose()?;
        let own = ["localhost".to_owned(), "127.0.0.1".to_owned(), "[::1]".to_owned(), bracketed(bind)];
        let hosts = own.into_iter().chain(hosts.iter().map(|host| host.to_ascii_lowercase())).collect();
        Ok(Self { tokens: tokens.unwrap_or_default(), hosts })
    }

    /// Whether requests need a token.
    #[must_use]
    pub fn has_tokens(&self) -> bool {
        !self.tokens.is_empty()
    }

    /// Whether the service answers under the name in a `Host` header, at any port. The check stops pages of other
    /// origins whose names resolve to this machine.
    #[must_use]
    pub fn is_known_host(&self, host: &str) -> bool {
        let name = match host.rfind(':') {
            Some(colon) if !host.ends_with(']') => &host[..colon],
            _ => host,
        };
        self.hosts.contains(&name.to_ascii_lowercase())
    }

    /// The client whose token a request carries, if that token has a scope.
    ///
    /// # Errors
    /// [`AccessError`].
    pub fn client(&self, headers: &HeaderMap, scope: Scope) -> Result<Client, AccessError> {
        if self.tokens.is_empty() {
            return Ok(Client::default());
        }
        let given = headers.get(header::AUTHORIZATION).and_then(|v| v.to_str().ok());
        let (scheme, token) = given.and_then(|text| text.split_once(' ')).ok_or(AccessError::Unauthorized)?;
        if !scheme.eq_ignore_ascii_case("bearer") {
            return Err(AccessError::Unauthorized);
        }
        // Digests are compared, so the time that a comparison takes reveals nothing about a token.
        let sha256 = digest::of_bytes(token.trim().as_bytes());
        let token = self.tokens.iter().find(|known| known.sha256 == sha256).ok_or(AccessError::Unauthorized)?;
        if token.scopes.contains(&scope) { Ok(Client(token.name.clone())) } else { Err(AccessError::Forbidden(scope)) }
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

#[cfg(test)]
mod tests {
    use super::{AccessRules, Client, Scope, parse_tokens};
    use axum::http::{HeaderMap, HeaderValue, Method};
    use meniscus_jobs::system::digest;

    fn rules() -> AccessRules {
        let line = |name: &str, scopes: &str| format!("{name} {scopes} sha256:{}\n", digest::of_bytes(name.as_bytes()));
        let mut rules = AccessRules::new(None, &["Sim.Example".into()], [10, 0, 0, 1].into()).unwrap();
        rules.tokens =
            parse_tokens(&(line("alice", "read,submit") + "# a comment\n\n" + &line("bob", "read"))).unwrap();
        rules
    }

    #[test]
    fn tokens_open_what_their_scopes_say() {
        let rules = rules();
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
        let rules = rules();
        for host in ["localhost", "LOCALHOST:99", "127.0.0.1:1", "[::1]:80", "[::1]", "sim.example:443", "10.0.0.1"] {
            assert!(rules.is_known_host(host), "{host}");
        }
        for host in ["evil.example", "localhost.evil.example:80", "", "10.0.0.2", "[::2]:80"] {
            assert!(!rules.is_known_host(host), "{host}");
        }
    }

    #[test]
    fn every_path_has_its_scope() {
        for (method, path, scope) in [
            (Method::GET, "/healthz", None),
            (Method::GET, "/problems/unauthorized", None),
            (Method::GET, "/metrics", Some(Scope::Read)),
            (Method::POST, "/v1/jobs", Some(Scope::Submit)),
            (Method::POST, "/v1/studies/std_1/retry", Some(Scope::Submit)),
            (Method::POST, "/v1/jobs/job_1/cancel", Some(Scope::Control)),
            (Method::DELETE, "/v1/uploads/upl_1", Some(Scope::Control)),
            (Method::POST, "/v1/jobs/job_1/checkpoints", Some(Scope::Control)),
        ] {
            assert_eq!(Scope::needed(&method, path), scope, "{method} {path}");
        }
    }
}
