//! Declarations of parameters: name, type, range, default, meaning, and whether a restart may change them.

/// One parameter of a scene or of a choice.
#[derive(Debug, Clone, Copy)]
pub struct Parameter {
    /// Name in JSON.
    pub name: &'static str,
    /// What it means, in one line.
    pub doc: &'static str,
    /// Type and range.
    pub kind: Kind,
    /// What holds when it is not given.
    pub default: Default,
    /// Whether a restart from a checkpoint may change it.
    pub restart_safe: bool,
}

/// What holds when a parameter is not given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Default {
    /// It must be given.
    Required,
    /// It may be absent or null; the scene then decides.
    Absent,
    /// This JSON.
    Json(&'static str),
    /// This JSON; but null may be given and has a meaning of its own.
    JsonOrNull(&'static str),
}

/// Type and range of a parameter.
#[derive(Debug, Clone, Copy)]
pub enum Kind {
    /// A number; `least`/`most` inclusive, `above`/`below` exclusive.
    Number {
        /// Greater than.
        above: Option<f64>,
        /// Not less than.
        least: Option<f64>,
        /// Less than.
        below: Option<f64>,
        /// Not greater than.
        most: Option<f64>,
    },
    /// A whole number in a range.
    Integer {
        /// Least.
        least: u64,
        /// Most.
        most: u64,
    },
    /// True or false.
    Flag,
    /// Text, such as the name of a file.
    Text,
    /// Two or three numbers.
    Vector {
        /// Whether all must be positive.
        positive: bool,
    },
    /// One of several variants: `{"type": NAME, …}` or the bare name.
    Choice(fn() -> &'static [Variant]),
    /// An object with parameters of its own.
    Group(&'static [Parameter]),
    /// A list of such choices, at least so many.
    Choices {
        /// The variants.
        variants: fn() -> &'static [Variant],
        /// Least length.
        least: usize,
    },
    /// One of several words.
    Word(&'static [&'static str]),
}

/// One variant of a choice.
#[derive(Debug)]
pub struct Variant {
    /// The `type`.
    pub name: &'static str,
    /// What it means.
    pub doc: &'static str,
    /// Its parameters.
    pub parameters: &'static [Parameter],
}

/// Any number.
pub const ANY: Kind = Kind::Number { above: None, least: None, below: None, most: None };
/// A number greater than zero.
pub const POSITIVE: Kind = Kind::Number { above: Some(0.0), least: None, below: None, most: None };
/// A number not less than zero.
pub const NOT_NEGATIVE: Kind = Kind::Number { above: None, least: Some(0.0), below: None, most: None };

impl Parameter {
    /// A parameter that a restart may not change.
    #[must_use]
    pub const fn new(name: &'static str, doc: &'static str, kind: Kind, default: Default) -> Self {
        Self { name, doc, kind, default, restart_safe: false }
    }

    /// A parameter that a restart may change.
    #[must_use]
    pub const fn restart_safe(name: &'static str, doc: &'static str, kind: Kind, default: Default) -> Self {
        Self { name, doc, kind, default, restart_safe: true }
    }
}
