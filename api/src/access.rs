//! Access rules: tokens with scopes, and the host names under which the service answers.

pub mod tickets;
mod tokens;

pub use tokens::{ME, TokenFileError};

use axum::http::{HeaderMap, Method, header};
use base64::Engine;
use meniscus_jobs::system::digest;
use std::collections::BTreeSet;
use std::io::Read;
use std::net::IpAddr;
use std::path::Path;
use std::sync::{Arc, PoisonError, RwLock};
use tokens::Token;

/// Permission that a token carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scope {
    /// Read all objects and files.
    Read,
    /// Create jobs, studies, uploads and estimates.
    Submit,
    /// Cancel, pause, resume, change and delete what is one's own, and request checkpoints.
    Control,
    /// The same of what others made.
    Admin,
}

impl Scope {
    /// All scopes.
    pub const ALL: [Self; 4] = [Self::Read, Self::Submit, Self::Control, Self::Admin];

    /// Name of the scope in token files and headers.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Submit => "submit",
            Self::Control => "control",
            Self::Admin => "admin",
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
            // A ticket lets its holder read.
            Method::POST if path == "/v1/tickets" => Some(Self::Read),
            Method::GET | Method::HEAD => Some(Self::Read),
            Method::POST if creates => Some(Self::Submit),
            _ => Some(Self::Control),
        }
    }
}

/// The client that sent a request, by the token that it carries. Without tokens there is one client, which may do everything.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Client {
    /// Name of the token; empty while the service has no tokens. Idempotency keys and budgets are kept apart by it.
    pub name: String,
    /// Whether it may change what others made.
    pub is_admin: bool,
}

impl Client {
    /// The name as owner of what the client makes; None while the service has no tokens.
    #[must_use]
    pub fn owner(&self) -> Option<String> {
        Some(self.name.clone()).filter(|name| !name.is_empty())
    }

    /// Whether the client may change what this owner made. What was made without tokens belongs to all.
    #[must_use]
    pub fn may_change(&self, owner: Option<&str>) -> bool {
        self.name.is_empty() || self.is_admin || owner.is_none_or(|owner| owner == self.name)
    }
}

/// A secret of 256 random bits as text.
///
/// # Errors
/// When the system has no random numbers.
pub fn secret() -> std::io::Result<String> {
    let mut bytes = [0_u8; 32];
    std::fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(base64::engine::general_purpose::URL_SAFE_NO_PAD.encode(bytes))
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

/// What the access rules are made of.
#[derive(Debug, Clone, Default)]
pub struct AccessSources<'a> {
    /// File of the tokens.
    pub token_file: Option<&'a Path>,
    /// Additional host names.
    pub hosts: &'a [String],
    /// Origins whose pages may use the service.
    pub origins: &'a [String],
}

/// Access rules of a service.
#[derive(Debug, Clone)]
pub struct AccessRules {
    tokens: Vec<Token>,
    hosts: BTreeSet<String>,
    origins: BTreeSet<String>,
}

impl AccessRules {
    /// Rules from their sources and the address that the service listens on.
    ///
    /// # Errors
    /// [`TokenFileError`].
    pub fn new(sources: &AccessSources, bind: IpAddr) -> Result<Self, TokenFileError> {
        let read = |path: &Path| {
            let text = std::fs::read_to_string(path)
                .map_err(|error| TokenFileError::Io { path: path.display().to_string(), error })?;
            tokens::parse(&text)
        };
        let tokens = sources.token_file.map(read).transpose()?;
        let own = ["localhost".to_owned(), "127.0.0.1".to_owned(), "[::1]".to_owned(), bracketed(bind)];
        let hosts = own.into_iter().chain(sources.hosts.iter().map(|host| host.to_ascii_lowercase())).collect();
        let origins = sources.origins.iter().map(|origin| origin.trim_end_matches('/').to_ascii_lowercase()).collect();
        Ok(Self { tokens: tokens.unwrap_or_default(), hosts, origins })
    }

    /// Whether pages of an origin, such as `https://lab.example:8443`, may use the service.
    #[must_use]
    pub fn is_known_origin(&self, origin: &str) -> bool {
        self.origins.contains(&origin.to_ascii_lowercase())
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
        let is_admin = token.scopes.contains(&Scope::Admin);
        let may = token.scopes.contains(&scope) || is_admin && scope == Scope::Control;
        if may { Ok(Client { name: token.name.clone(), is_admin }) } else { Err(AccessError::Forbidden(scope)) }
    }
}

/// Access rules that can be replaced while the service runs.
#[derive(Debug, Clone)]
pub struct SharedAccess(Arc<RwLock<Arc<AccessRules>>>);

impl SharedAccess {
    /// Begins with these rules.
    #[must_use]
    pub fn new(rules: AccessRules) -> Self {
        Self(Arc::new(RwLock::new(Arc::new(rules))))
    }

    /// The present rules.
    #[must_use]
    pub fn current(&self) -> Arc<AccessRules> {
        Arc::clone(&self.0.read().unwrap_or_else(PoisonError::into_inner))
    }

    /// Replaces the rules.
    pub fn replace(&self, rules: AccessRules) {
        *self.0.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(rules);
    }
}

fn bracketed(ip: IpAddr) -> String {
    if ip.is_ipv6() { format!("[{ip}]") } else { ip.to_string() }
}

#[cfg(test)]
mod tests {
    use super::tokens::parse as parse_tokens;
    use super::{AccessRules, AccessSources, Client, Scope};
    use axum::http::{HeaderMap, HeaderValue, Method};
    use meniscus_jobs::system::digest;

    fn rules() -> AccessRules {
        let line = |name: &str, scopes: &str| format!("{name} {scopes} sha256:{}\n", digest::of_bytes(name.as_bytes()));
        let mut rules = AccessRules::new(
            &AccessSources { hosts: &["Sim.Example".into()], ..AccessSources::default() },
            [10, 0, 0, 1].into(),
        )
        .unwrap();
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
        assert_eq!(
            rules.client(&with("Bearer alice"), Scope::Submit).unwrap(),
            Client { name: "alice".into(), is_admin: false }
        );
        for (text, scope) in [
            ("Bearer bob", Scope::Submit),
            ("Bearer eve", Scope::Read),
            ("Basic alice", Scope::Read),
            ("Bearer", Scope::Read),
        ] {
            assert!(rules.client(&with(text), scope).is_err(), "{text}");
        }
        assert!(rules.client(&HeaderMap::new(), Scope::Read).is_err());
        for text in [&format!("me read sha256:{}", "0".repeat(64)), "a read", "a fly sha256:00", "a read sha256:0", ""]
        {
            assert!(parse_tokens(text).is_err(), "{text}");
        }
    }

    #[test]
    fn what_others_made_is_changed_by_admins_alone() {
        let [alice, root, anybody] = [("alice", false), ("root", true), ("", false)]
            .map(|(name, is_admin)| Client { name: name.to_owned(), is_admin });
        for (client, owner, may) in [
            (&alice, Some("alice"), true),
            (&alice, Some("bob"), false),
            (&alice, None, true),
            (&root, Some("bob"), true),
            (&anybody, Some("bob"), true),
        ] {
            assert_eq!(client.may_change(owner), may, "{client:?} {owner:?}");
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
            (Method::PATCH, "/v1/jobs/job_1", Some(Scope::Control)),
            (Method::POST, "/v1/jobs/actions", Some(Scope::Control)),
            (Method::POST, "/v1/tickets", Some(Scope::Read)),
            (Method::POST, "/v1/jobs/job_1/checkpoints", Some(Scope::Control)),
        ] {
            assert_eq!(Scope::needed(&method, path), scope, "{method} {path}");
        }
    }
}
