//! Lengths of functions.

use crate::code::{block_end, tokens};

/// Every function of a source text, test functions left out: its name, and its lines from `fn` to the closing brace.
pub fn functions(text: &str) -> Vec<(String, usize)> {
    let tokens = tokens(text);
    let mut found = Vec::new();
    for k in 0..tokens.len().saturating_sub(1) {
        // A type such as `fn(f64) -> f64` has no name.
        if tokens[k].text != "fn" || !tokens[k + 1].is_word() {
            continue;
        }
        let mut depth = 0_i32;
        for place in k + 2..tokens.len() {
            match tokens[place].text.as_str() {
                "(" | "[" => depth += 1,
                ")" | "]" => depth -= 1,
                ";" if depth == 0 => break,
                "{" if depth == 0 => {
                    let end = block_end(&tokens, place);
                    found.push((tokens[k + 1].text.clone(), tokens[end].line - tokens[k].line + 1));
                    break;
                }
                _ => {}
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::functions;

    #[test]
    fn lines_are_counted_from_the_name_to_the_brace() {
        let text = "trait T { fn none(x: [u8; 3]); }\nfn one() { \"}\" }\n#[test]\nfn three<const D: usize>(\n    f: fn(f64) -> f64,\n) {}\n";
        assert_eq!(functions(text), [("one".to_owned(), 1), ("three".to_owned(), 3)]);
    }
}
