//! The token file: one token a line, by its digest.

use super::Scope;
use std::collections::BTreeSet;

/// A token that the service accepts.
#[derive(Debug, Clone)]
pub(super) struct Token {
    pub(super) name: String,
    pub(super) scopes: BTreeSet<Scope>,
    pub(super) sha256: String,
}

/// Why a token file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TokenFileError {
    /// The file cannot be read.
    #[error("the token file {path} cannot be read: {error}")]
    Io {
        /// Path of the file.
        path: String,
        /// What the system said.
        error: std::io::Error,
    },
    /// A line does not describe a token.
    #[error(
        "line {0} of the token file must be NAME SCOPES sha256:DIGEST, with scopes among read, submit, control, admin; `meniscus token \
         NAME` prints such a line"
    )]
    Line(usize),
    /// Two lines have the same name.
    #[error("the token file has two tokens with the name {0}; names must differ")]
    Twice(String),
    /// A token has a name with a meaning of its own.
    #[error("a token must not have the name {0:?}, which stands for the client itself in filters")]
    Reserved(String),
    /// The file has no token.
    #[error("the token file has no token; `meniscus token NAME` prints a line for it")]
    Empty,
}

/// Name that stands for the client itself in filters.
pub const ME: &str = "me";

/// The tokens of a file.
///
/// # Errors
/// [`TokenFileError`].
pub(super) fn parse(text: &str) -> Result<Vec<Token>, TokenFileError> {
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
        if token.name == ME {
            return Err(TokenFileError::Reserved(token.name));
        }
        tokens.push(token);
    }
    if tokens.is_empty() { Err(TokenFileError::Empty) } else { Ok(tokens) }
}
