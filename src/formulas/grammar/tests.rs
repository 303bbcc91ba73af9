//! Precedence, and places of errors.

use super::super::error::FormulaError;
use super::{Graph, Names, check_syntax, parse};

fn value(text: &str) -> f64 {
    let mut graph = Graph::default();
    let names = Names { variables: &[], parameters: &[("a".to_owned(), 3.0)] };
    let node = parse(text, names, &mut graph).unwrap_or_else(|errors| panic!("{text}: {errors:?}"));
    graph.constant_at(node).unwrap()
}

fn errors(text: &str) -> Vec<FormulaError> {
    let names = Names { variables: &["x", "y"], parameters: &[("alpha".to_owned(), 3.0)] };
    parse(text, names, &mut Graph::default()).unwrap_err()
}

#[test]
fn precedence_is_that_of_mathematics() {
    for (text, expected) in [
        ("2 + 3*4^2", 50.0),
        ("-2^2", -4.0),
        ("2^-1", 0.5),
        ("2^3^2", 512.0),
        ("8/4/2", 1.0),
        ("1 - 2 - 3", -4.0),
        ("2**3", 8.0),
        ("--2", 2.0),
        ("2 < 3 and not 4 < 3", 1.0),
        ("not 1 < 2 or a > 2", 1.0),
        ("if(a >= 3, 10, 20)", 10.0),
        ("min(4, a, 5) + max(1, 2)", 5.0),
        ("clamp(7, 0, 5) + step(0) + sign(-3)", 5.0),
        ("smoothstep(0, 2, 1)", 0.5),
        ("hypot(3, 4) + mod(-1, a)", 7.0),
        ("round(2.5) + atan2(0, 1)", 2.0),
    ] {
        assert!((value(text) - expected).abs() < 1e-15, "{text} = {}", value(text));
    }
}

#[test]
fn all_unknown_names_are_told_with_their_columns() {
    let found = errors("alpa*x + sine(y) + z");
    let places: Vec<usize> = found.iter().map(|error| error.column).collect();
    assert_eq!(places, [1, 10, 20]);
    assert_eq!(found[0].did_you_mean.as_deref(), Some("alpha"));
    assert_eq!(found[1].did_you_mean.as_deref(), Some("sin"));
    assert!(found[2].allowed.contains("x, y, alpha, pi, e"));
}

#[test]
fn malformed_formulas_are_told_where_they_break() {
    for (text, column, part) in [
        ("2x", 2, "*"),
        ("(x + 1", 7, "\")\""),
        ("x +", 4, "ends"),
        ("x y", 3, "*"),
        ("0 < x < 1", 7, "two sides"),
        ("sin x", 1, "sin(a)"),
        ("1/0", 2, "by 0"),
        ("x/(2 - 2)", 2, "by 0"),
        ("10^400", 3, "inf"),
        ("sqrt(-1)", 1, "NaN"),
        ("atan2(x)", 1, "1 arguments"),
        ("x)", 2, "\")\""),
        ("", 1, "ends"),
    ] {
        let found = errors(text);
        let said = format!("{} {}", found[0].detail, found[0].allowed);
        assert!(found[0].column == column && said.contains(part), "{text}: {found:?}");
    }
}

#[test]
fn too_long_and_too_deep_formulas_are_refused() {
    assert!(errors(&"x+".repeat(3000))[0].allowed.contains("4096"));
    assert!(errors(&format!("{}x{}", "(".repeat(500), ")".repeat(500)))[0].detail.contains("inside one another"));
    assert!(errors(&"-".repeat(4000))[0].detail.contains("inside one another"));
    assert!(errors(&format!("{}2", "2^".repeat(2000)))[0].detail.contains("inside one another"));
}

#[test]
fn syntax_is_checked_without_names() {
    assert_eq!(check_syntax("a*sin(b)/(c - d)"), Ok(()));
    assert!(check_syntax("a*(b").is_err());
}
