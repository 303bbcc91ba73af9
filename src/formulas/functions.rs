//! The operations and functions of formulas: names, numbers of arguments, values of single numbers.

/// A function of one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum UnaryOp {
    /// −a
    Neg,
    /// 1 where a is 0, else 0
    Not,
    /// |a|
    Abs,
    /// −1, 0 or 1
    Sign,
    /// 1 where a ≥ 0, else 0
    Step,
    /// √a
    Sqrt,
    /// ∛a
    Cbrt,
    /// eᵃ
    Exp,
    /// natural logarithm
    Ln,
    /// logarithm to base 10
    Log10,
    /// logarithm to base 2
    Log2,
    /// sine
    Sin,
    /// cosine
    Cos,
    /// tangent
    Tan,
    /// arc sine
    Asin,
    /// arc cosine
    Acos,
    /// arc tangent
    Atan,
    /// hyperbolic sine
    Sinh,
    /// hyperbolic cosine
    Cosh,
    /// hyperbolic tangent
    Tanh,
    /// largest whole number that is not above a
    Floor,
    /// least whole number that is not below a
    Ceil,
    /// nearest whole number, halves to even
    Round,
}

/// A function of two numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BinaryOp {
    /// a + b
    Add,
    /// a − b
    Sub,
    /// a b
    Mul,
    /// a/b
    Div,
    /// aᵇ
    Pow,
    /// the lesser
    Min,
    /// the greater
    Max,
    /// angle of (b, a)
    Atan2,
    /// √(a² + b²)
    Hypot,
    /// a − b ⌊a/b⌋
    Mod,
    /// 1 where a < b, else 0
    Less,
    /// 1 where a ≤ b, else 0
    LessEqual,
    /// 1 where both are not 0, else 0
    And,
    /// 1 where one is not 0, else 0
    Or,
}

fn truth(is_true: bool) -> f64 {
    f64::from(u8::from(is_true))
}

impl UnaryOp {
    /// The value at one number.
    #[must_use]
    pub fn apply(self, a: f64) -> f64 {
        match self {
            Self::Neg => -a,
            Self::Not => truth(a == 0.0),
            Self::Abs => a.abs(),
            Self::Sign => {
                if a > 0.0 {
                    1.0
                } else if a < 0.0 {
                    -1.0
                } else {
                    a * 0.0
                }
            }
            Self::Step => truth(a >= 0.0),
            Self::Sqrt => a.sqrt(),
            Self::Cbrt => a.cbrt(),
            Self::Exp => a.exp(),
            Self::Ln => a.ln(),
            Self::Log10 => a.log10(),
            Self::Log2 => a.log2(),
            Self::Sin => a.sin(),
            Self::Cos => a.cos(),
            Self::Tan => a.tan(),
            Self::Asin => a.asin(),
            Self::Acos => a.acos(),
            Self::Atan => a.atan(),
            Self::Sinh => a.sinh(),
            Self::Cosh => a.cosh(),
            Self::Tanh => a.tanh(),
            Self::Floor => a.floor(),
            Self::Ceil => a.ceil(),
            Self::Round => a.round_ties_even(),
        }
    }
}

impl BinaryOp {
    /// The value at two numbers. The lesser or greater of a NaN and a number is the NaN: nothing undefined is hidden.
    #[must_use]
    pub fn apply(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Add => a + b,
            Self::Sub => a - b,
            Self::Mul => a * b,
            Self::Div => a / b,
            Self::Pow => a.powf(b),
            Self::Min | Self::Max if a.is_nan() || b.is_nan() => f64::NAN,
            Self::Min => a.min(b),
            Self::Max => a.max(b),
            Self::Atan2 => a.atan2(b),
            Self::Hypot => a.hypot(b),
            Self::Mod => a - b * (a / b).floor(),
            Self::Less => truth(a < b),
            Self::LessEqual => truth(a <= b),
            Self::And => truth(a != 0.0 && b != 0.0),
            Self::Or => truth(a != 0.0 || b != 0.0),
        }
    }
}

/// How a function of a formula is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Meaning {
    Unary(UnaryOp),
    Binary(BinaryOp),
    /// The least or greatest of two or more.
    Fold(BinaryOp),
    /// `if(c, a, b)`
    If,
    /// `clamp(x, low, high)`
    Clamp,
    /// `smoothstep(low, high, x)`
    Smoothstep,
}

/// A function of formulas.
#[derive(Debug, Clone, Copy)]
pub struct Function {
    /// Its name.
    pub name: &'static str,
    /// How it is called.
    pub call: &'static str,
    /// What it is.
    pub doc: &'static str,
    pub(super) meaning: Meaning,
}

impl Function {
    /// The least and the largest number of arguments.
    #[must_use]
    pub fn arguments(&self) -> (usize, usize) {
        match self.meaning {
            Meaning::Unary(_) => (1, 1),
            Meaning::Binary(_) => (2, 2),
            Meaning::Fold(_) => (2, 16),
            Meaning::If | Meaning::Clamp | Meaning::Smoothstep => (3, 3),
        }
    }
}

macro_rules! functions {
    ($( $name:literal $call:literal $doc:literal $meaning:expr; )*) => {
        /// All functions of formulas.
        pub const FUNCTIONS: &[Function] = &[$( Function { name: $name, call: $call, doc: $doc, meaning: $meaning } ),*];
    };
}

functions! {
    "abs" "abs(a)" "|a|" Meaning::Unary(UnaryOp::Abs);
    "sign" "sign(a)" "−1, 0 or 1" Meaning::Unary(UnaryOp::Sign);
    "step" "step(a)" "1 where a ≥ 0, else 0" Meaning::Unary(UnaryOp::Step);
    "sqrt" "sqrt(a)" "square root" Meaning::Unary(UnaryOp::Sqrt);
    "cbrt" "cbrt(a)" "cube root" Meaning::Unary(UnaryOp::Cbrt);
    "exp" "exp(a)" "e to the power a" Meaning::Unary(UnaryOp::Exp);
    "ln" "ln(a)" "natural logarithm" Meaning::Unary(UnaryOp::Ln);
    "log" "log(a)" "natural logarithm" Meaning::Unary(UnaryOp::Ln);
    "log10" "log10(a)" "logarithm to base 10" Meaning::Unary(UnaryOp::Log10);
    "log2" "log2(a)" "logarithm to base 2" Meaning::Unary(UnaryOp::Log2);
    "sin" "sin(a)" "sine of an angle in rad" Meaning::Unary(UnaryOp::Sin);
    "cos" "cos(a)" "cosine of an angle in rad" Meaning::Unary(UnaryOp::Cos);
    "tan" "tan(a)" "tangent of an angle in rad" Meaning::Unary(UnaryOp::Tan);
    "asin" "asin(a)" "arc sine" Meaning::Unary(UnaryOp::Asin);
    "acos" "acos(a)" "arc cosine" Meaning::Unary(UnaryOp::Acos);
    "atan" "atan(a)" "arc tangent" Meaning::Unary(UnaryOp::Atan);
    "sinh" "sinh(a)" "hyperbolic sine" Meaning::Unary(UnaryOp::Sinh);
    "cosh" "cosh(a)" "hyperbolic cosine" Meaning::Unary(UnaryOp::Cosh);
    "tanh" "tanh(a)" "hyperbolic tangent" Meaning::Unary(UnaryOp::Tanh);
    "floor" "floor(a)" "largest whole number that is not above a" Meaning::Unary(UnaryOp::Floor);
    "ceil" "ceil(a)" "least whole number that is not below a" Meaning::Unary(UnaryOp::Ceil);
    "round" "round(a)" "nearest whole number, halves to even" Meaning::Unary(UnaryOp::Round);
    "pow" "pow(a, b)" "a to the power b" Meaning::Binary(BinaryOp::Pow);
    "atan2" "atan2(y, x)" "angle of (x, y) in rad" Meaning::Binary(BinaryOp::Atan2);
    "hypot" "hypot(a, b)" "√(a² + b²)" Meaning::Binary(BinaryOp::Hypot);
    "mod" "mod(a, b)" "a − b ⌊a/b⌋" Meaning::Binary(BinaryOp::Mod);
    "min" "min(a, b, …)" "the least" Meaning::Fold(BinaryOp::Min);
    "max" "max(a, b, …)" "the greatest" Meaning::Fold(BinaryOp::Max);
    "if" "if(c, a, b)" "a where c is not 0, else b" Meaning::If;
    "clamp" "clamp(a, low, high)" "a, kept between low and high" Meaning::Clamp;
    "smoothstep" "smoothstep(low, high, a)" "0 below low, 1 above high, 3s² − 2s³ between them" Meaning::Smoothstep;
}
