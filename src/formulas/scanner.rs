//! From text to tokens, each with its column.

use super::error::FormulaError;

/// A token of a formula.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Token {
    Number(f64),
    Name(String),
    /// An operator, a bracket or a comma.
    Sign(&'static str),
    End,
}

/// A token and the column of its first character, counted from 1.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Placed {
    pub token: Token,
    pub column: usize,
}

/// Signs by length: longer ones first. `**` is another spelling of `^`.
const SIGNS: [(&str, &str); 15] = [
    ("**", "^"),
    ("<=", "<="),
    (">=", ">="),
    ("<", "<"),
    (">", ">"),
    ("+", "+"),
    ("-", "-"),
    ("*", "*"),
    ("/", "/"),
    ("^", "^"),
    ("(", "("),
    (")", ")"),
    (",", ","),
    ("−", "-"),
    ("·", "*"),
];

/// All tokens of a text, and the end.
pub(super) fn scan(text: &str) -> Result<Vec<Placed>, FormulaError> {
    let mut tokens = Vec::new();
    let mut rest = text;
    let mut column = 1;
    loop {
        let blank: usize = rest.chars().take_while(|c| c.is_whitespace()).map(char::len_utf8).sum();
        column += rest[..blank].chars().count();
        rest = &rest[blank..];
        let (token, length) = first_token(rest, column)?;
        let is_end = token == Token::End;
        tokens.push(Placed { token, column });
        if is_end {
            return Ok(tokens);
        }
        column += rest[..length].chars().count();
        rest = &rest[length..];
    }
}

/// The token that a text begins with, and its length in bytes.
fn first_token(text: &str, column: usize) -> Result<(Token, usize), FormulaError> {
    let Some(first) = text.chars().next() else { return Ok((Token::End, 0)) };
    if first.is_ascii_digit() || first == '.' {
        return number(text, column);
    }
    if first.is_ascii_alphabetic() || first == '_' {
        let length = text.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '_').count();
        return Ok((Token::Name(text[..length].to_owned()), length));
    }
    if let Some((written, sign)) = SIGNS.iter().find(|(written, _)| text.starts_with(written)) {
        return Ok((Token::Sign(sign), written.len()));
    }
    let detail = if first == '=' || first == '!' {
        "equality of computed numbers is not a test; compare with <, <=, > or >=".to_owned()
    } else {
        format!("the character {first:?} does not belong to formulas")
    };
    Err(FormulaError::new(column, detail).allowing("numbers, names, + - * / ^ ( ) , < <= > >= and or not"))
}

/// A number: digits with a point and an exponent. An exponent needs digits: `2e` is the number 2 before the name e.
fn number(text: &str, column: usize) -> Result<(Token, usize), FormulaError> {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let mut length = digits(0);
    if bytes.get(length) == Some(&b'.') {
        length += 1 + digits(length + 1);
    }
    if matches!(bytes.get(length), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(length + 1), Some(b'+' | b'-')));
        let exponent = digits((length + 1 + sign).min(bytes.len()));
        if exponent > 0 {
            length += 1 + sign + exponent;
        }
    }
    let value: Option<f64> = text[..length].parse().ok().filter(|value: &f64| value.is_finite());
    match value {
        Some(value) => Ok((Token::Number(value), length)),
        None => Err(FormulaError::new(column, format!("{} is not a number", &text[..length]))
            .allowing("a finite number such as 2.5e-3")),
    }
}

#[cfg(test)]
mod tests {
    use super::{Token, scan};

    #[test]
    fn tokens_have_their_columns() {
        let found = scan("2.5e-3 * sin(x) <= .5").unwrap();
        let columns: Vec<usize> = found.iter().map(|t| t.column).collect();
        assert_eq!(columns, [1, 8, 10, 13, 14, 15, 17, 20, 22]);
        assert_eq!(found[0].token, Token::Number(2.5e-3));
        assert_eq!(found[6].token, Token::Sign("<="));
    }

    #[test]
    fn what_does_not_belong_is_named_with_its_column() {
        assert_eq!(scan("x + $").unwrap_err().column, 5);
        assert!(scan("x == 2").unwrap_err().detail.contains("equality"));
        assert!(scan(".").is_err() && scan("1e999").is_err());
    }
}
