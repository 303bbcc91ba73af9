//! Rust source text as tokens, without comments, literals and test items: enough to follow imports and to count lines.

use std::fs;
use std::path::{Path, PathBuf};

/// Folders with the sources of the three crates.
pub const CRATES: [&str; 3] = ["src", "jobs/src", "api/src"];

/// Folder of the workspace.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Adds every Rust file below a folder to the list, in the order of their names.
pub fn sources(directory: &Path, into: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = fs::read_dir(directory).unwrap().flatten().map(|entry| entry.path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            sources(&path, into);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            into.push(path);
        }
    }
}

/// Every source file of the three crates: its path from the root of the workspace, and its text.
pub fn all_sources() -> Vec<(String, String)> {
    let mut files = Vec::new();
    for folder in CRATES {
        sources(&root().join(folder), &mut files);
    }
    let relative = |path: &Path| path.strip_prefix(root()).unwrap().to_str().unwrap().to_owned();
    files.iter().map(|path| (relative(path), fs::read_to_string(path).unwrap())).collect()
}

/// Whether a file has tests alone.
pub fn is_test_file(path: &str) -> bool {
    path.split('/').any(|part| part == "tests" || part == "tests.rs")
}

/// A token and the line that it stands on, from 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Token {
    /// An identifier, a keyword, a number, `::`, or one character.
    pub text: String,
    /// Line.
    pub line: usize,
}

impl Token {
    /// Whether this is an identifier or a keyword.
    pub fn is_word(&self) -> bool {
        self.text.starts_with(|c: char| c.is_alphabetic() || c == '_')
    }
}

/// The tokens of a source text, items under `#[cfg(test)]` left out.
pub fn tokens(text: &str) -> Vec<Token> {
    without_tests(&all_tokens(text))
}

fn all_tokens(text: &str) -> Vec<Token> {
    let characters: Vec<char> = text.chars().collect();
    let at = |k: usize| characters.get(k).copied().unwrap_or('\0');
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let (mut found, mut line, mut k) = (Vec::new(), 1, 0);
    while k < characters.len() {
        let start = k;
        let c = at(k);
        if c.is_whitespace() {
            k += 1;
        } else if c == '/' && at(k + 1) == '/' {
            while k < characters.len() && at(k) != '\n' {
                k += 1;
            }
        } else if c == '/' && at(k + 1) == '*' {
            k += 2;
            while k < characters.len() && !(at(k) == '*' && at(k + 1) == '/') {
                k += 1;
            }
            k += 2;
        } else if let Some(end) = literal_end(&characters, k) {
            k = end;
        } else if is_part(c) {
            while is_part(at(k)) {
                k += 1;
            }
            found.push(Token { text: characters[start..k].iter().collect(), line });
        } else {
            k += if c == ':' && at(k + 1) == ':' { 2 } else { 1 };
            found.push(Token { text: characters[start..k].iter().collect(), line });
        }
        line += characters[start..k.min(characters.len())].iter().filter(|c| **c == '\n').count();
    }
    found
}

/// The place behind a string, a character or a byte literal that begins at `k`.
fn literal_end(characters: &[char], k: usize) -> Option<usize> {
    let at = |k: usize| characters.get(k).copied().unwrap_or('\0');
    let quote = match at(k) {
        'b' | 'r' | 'c' => {
            let mut end = k;
            while matches!(at(end), 'b' | 'r' | 'c') && end < k + 2 {
                end += 1;
            }
            let hashes = (end..).take_while(|end| at(*end) == '#').count();
            let is_raw = at(end - 1) == 'r';
            if is_raw && at(end + hashes) == '"' {
                let close: Vec<char> = std::iter::once('"').chain(std::iter::repeat_n('#', hashes)).collect();
                let mut place = end + hashes + 1;
                while place < characters.len() && !characters[place..].starts_with(&close) {
                    place += 1;
                }
                return Some(place + close.len());
            }
            if hashes == 0 && (at(end) == '"' || at(end) == '\'') { end } else { return None }
        }
        '"' | '\'' => k,
        _ => return None,
    };
    // A lifetime has no second quote.
    if at(quote) == '\'' && at(quote + 1) != '\\' && at(quote + 2) != '\'' {
        return None;
    }
    let mut place = quote + 1;
    while place < characters.len() && at(place) != at(quote) {
        place += if at(place) == '\\' { 2 } else { 1 };
    }
    Some(place + 1)
}

fn without_tests(tokens: &[Token]) -> Vec<Token> {
    let marker = ["#", "[", "cfg", "(", "test", ")", "]"];
    let mut kept = Vec::new();
    let mut k = 0;
    while k < tokens.len() {
        let is_marked = tokens.len() - k > marker.len() && (0..marker.len()).all(|m| tokens[k + m].text == marker[m]);
        if !is_marked {
            kept.push(tokens[k].clone());
            k += 1;
            continue;
        }
        k += marker.len();
        while k < tokens.len() && tokens[k].text != ";" && tokens[k].text != "{" {
            k += 1;
        }
        k = if k < tokens.len() && tokens[k].text == "{" { block_end(tokens, k) + 1 } else { k + 1 };
    }
    kept
}

/// The index of the brace that closes the block that opens at `k`.
pub fn block_end(tokens: &[Token], k: usize) -> usize {
    let mut depth = 0_usize;
    for (place, token) in tokens.iter().enumerate().skip(k) {
        match token.text.as_str() {
            "{" => depth += 1,
            "}" if depth == 1 => return place,
            "}" => depth -= 1,
            _ => {}
        }
    }
    tokens.len().saturating_sub(1)
}

#[cfg(test)]
mod tests {
    use super::{Token, tokens};

    #[test]
    fn literals_comments_and_tests_leave_no_tokens() {
        let text = "fn a<'b>(x: &'b str) { x != \"{ // \\\" \" && r#\"}\"# ; '{' } // fn c\n#[cfg(test)]\nmod t { fn d() {} }\nfn e() {}";
        let words: Vec<(String, usize)> =
            tokens(text).into_iter().filter(Token::is_word).map(|t| (t.text, t.line)).collect();
        let expected = [("fn", 1), ("a", 1), ("b", 1), ("x", 1), ("b", 1), ("str", 1), ("x", 1), ("fn", 4), ("e", 4)];
        let words: Vec<(&str, usize)> = words.iter().map(|(word, line)| (word.as_str(), *line)).collect();
        assert_eq!(words, expected);
    }
}
