//! Functions of several numbers at a time.
//!
//! Every lane has the value that it would have beside any other numbers. Sine, cosine, exponential and natural logarithm have
//! an error of a few units in the last place; what they do not take is computed number by number.

use super::functions::{BinaryOp, UnaryOp};

/// Numbers side by side in a vector register.
pub(super) type Lanes = wide::f64x4;
/// How many.
pub(super) const LANES: usize = 4;

/// Angles up to here are reduced with full accuracy.
const LARGEST_ANGLE: f64 = 1e6;
/// The least number that is not subnormal.
const LEAST_NORMAL: f64 = f64::MIN_POSITIVE;

fn each(a: Lanes, function: impl Fn(f64) -> f64) -> Lanes {
    Lanes::from(a.to_array().map(function))
}

fn pairs(a: Lanes, b: Lanes, function: impl Fn(f64, f64) -> f64) -> Lanes {
    let (a, b) = (a.to_array(), b.to_array());
    Lanes::from(std::array::from_fn(|k| function(a[k], b[k])))
}

/// The fast function in the lanes where it holds, the exact one elsewhere.
#[inline(always)]
fn where_it_holds(a: Lanes, holds: Lanes, fast: impl Fn(Lanes) -> Lanes, exact: impl Fn(f64) -> f64) -> Lanes {
    let quick = fast(a);
    if holds.all() {
        return quick;
    }
    holds.select(quick, each(a, exact))
}

/// 1 where the mask is set, else 0.
#[inline(always)]
fn truth(mask: Lanes) -> Lanes {
    mask & Lanes::splat(1.0)
}

/// Applies a function of one number to all of `a`.
pub(super) fn unary(op: UnaryOp, to: &mut [Lanes], a: &[Lanes]) {
    #[inline(always)]
    fn map(to: &mut [Lanes], a: &[Lanes], function: impl Fn(Lanes) -> Lanes) {
        for (to, a) in to.iter_mut().zip(a) {
            *to = function(*a);
        }
    }
    let zero = Lanes::splat(0.0);
    let (largest, least) = (Lanes::splat(LARGEST_ANGLE), Lanes::splat(LEAST_NORMAL));
    match op {
        UnaryOp::Neg => map(to, a, |a| -a),
        UnaryOp::Abs => map(to, a, Lanes::abs),
        UnaryOp::Sqrt => map(to, a, Lanes::sqrt),
        UnaryOp::Floor => map(to, a, Lanes::floor),
        UnaryOp::Ceil => map(to, a, Lanes::ceil),
        UnaryOp::Not => map(to, a, |a| truth(a.simd_eq(zero))),
        UnaryOp::Step => map(to, a, |a| truth(a.simd_ge(zero))),
        UnaryOp::Sin => map(to, a, |a| where_it_holds(a, a.abs().simd_le(largest), |a| a.sin_cos().0, f64::sin)),
        UnaryOp::Cos => map(to, a, |a| where_it_holds(a, a.abs().simd_le(largest), |a| a.sin_cos().1, f64::cos)),
        UnaryOp::Exp => map(to, a, |a| where_it_holds(a, a.abs().simd_lt(Lanes::splat(700.0)), Lanes::exp, f64::exp)),
        UnaryOp::Ln => {
            let greatest = Lanes::splat(f64::MAX);
            map(to, a, |a| where_it_holds(a, a.simd_ge(least) & a.simd_le(greatest), Lanes::ln, f64::ln));
        }
        _ => map(to, a, |a| each(a, |a| op.apply(a))),
    }
}

/// Sines and cosines of all of `a`, with the values that [`unary`] gives.
pub(super) fn sine_and_cosine(sines: &mut [Lanes], cosines: &mut [Lanes], a: &[Lanes]) {
    let largest = Lanes::splat(LARGEST_ANGLE);
    for ((sine, cosine), a) in sines.iter_mut().zip(cosines).zip(a) {
        (*sine, *cosine) = a.sin_cos();
        let holds = a.abs().simd_le(largest);
        if !holds.all() {
            *sine = holds.select(*sine, each(*a, f64::sin));
            *cosine = holds.select(*cosine, each(*a, f64::cos));
        }
    }
}

/// Applies a function of two numbers to all of `a` and `b`.
pub(super) fn binary(op: BinaryOp, to: &mut [Lanes], a: &[Lanes], b: &[Lanes]) {
    #[inline(always)]
    fn map(to: &mut [Lanes], a: &[Lanes], b: &[Lanes], function: impl Fn(Lanes, Lanes) -> Lanes) {
        for ((to, a), b) in to.iter_mut().zip(a).zip(b) {
            *to = function(*a, *b);
        }
    }
    match op {
        BinaryOp::Add => map(to, a, b, |a, b| a + b),
        BinaryOp::Sub => map(to, a, b, |a, b| a - b),
        BinaryOp::Mul => map(to, a, b, |a, b| a * b),
        BinaryOp::Div => map(to, a, b, |a, b| a / b),
        BinaryOp::Less => map(to, a, b, |a, b| truth(a.simd_lt(b))),
        BinaryOp::LessEqual => map(to, a, b, |a, b| truth(a.simd_le(b))),
        BinaryOp::Min | BinaryOp::Max | BinaryOp::And | BinaryOp::Or | BinaryOp::Mod => {
            map(to, a, b, |a, b| pairs(a, b, |a, b| op.apply(a, b)));
        }
        BinaryOp::Pow | BinaryOp::Atan2 | BinaryOp::Hypot => map(to, a, b, |a, b| pairs(a, b, |a, b| op.apply(a, b))),
    }
}

/// `yes` in the lanes where the condition is not 0, else `no`.
pub(super) fn choose(to: &mut [Lanes], condition: &[Lanes], yes: &[Lanes], no: &[Lanes]) {
    let zero = Lanes::splat(0.0);
    for (((to, condition), yes), no) in to.iter_mut().zip(condition).zip(yes).zip(no) {
        *to = condition.simd_eq(zero).select(*no, *yes);
    }
}

#[cfg(test)]
mod tests {
    use super::super::functions::UnaryOp;
    use super::{Lanes, unary};

    #[test]
    fn lanes_agree_with_single_numbers() {
        let numbers = [
            -1e300,
            -1e7,
            -745.2,
            -30.5,
            -2.5,
            -1.0,
            -1e-9,
            0.0,
            5e-324,
            1e-300,
            0.3,
            1.0,
            2.5,
            3.0,
            12.7,
            709.9,
            1e5,
            3e6,
            1e300,
            f64::INFINITY,
            f64::NAN,
        ];
        for op in [
            UnaryOp::Neg,
            UnaryOp::Not,
            UnaryOp::Abs,
            UnaryOp::Sign,
            UnaryOp::Step,
            UnaryOp::Sqrt,
            UnaryOp::Exp,
            UnaryOp::Ln,
            UnaryOp::Sin,
            UnaryOp::Cos,
            UnaryOp::Floor,
            UnaryOp::Ceil,
            UnaryOp::Round,
            UnaryOp::Tanh,
        ] {
            for (k, x) in numbers.into_iter().enumerate() {
                // Beside other numbers in every lane.
                let beside: [f64; 4] =
                    std::array::from_fn(|lane| if lane == k % 4 { x } else { numbers[(k + lane) % numbers.len()] });
                let mut found = [Lanes::splat(0.0)];
                unary(op, &mut found, &[Lanes::from(beside)]);
                let (found, exact) = (found[0].to_array()[k % 4], op.apply(x));
                let alone = {
                    let mut found = [Lanes::splat(0.0)];
                    unary(op, &mut found, &[Lanes::splat(x)]);
                    found[0].to_array()[0]
                };
                assert!(alone.to_bits() == found.to_bits() || (alone.is_nan() && found.is_nan()), "{op:?}({x})");
                let (mut sine, mut cosine) = ([Lanes::splat(0.0)], [Lanes::splat(0.0)]);
                super::sine_and_cosine(&mut sine, &mut cosine, &[Lanes::from(beside)]);
                let pair = match op {
                    UnaryOp::Sin => Some(sine[0]),
                    UnaryOp::Cos => Some(cosine[0]),
                    _ => None,
                };
                let pair = pair.map_or(found, |pair| pair.to_array()[k % 4]);
                assert!(pair.to_bits() == found.to_bits() || (pair.is_nan() && found.is_nan()), "{op:?}({x})");
                let is_near = (found - exact).abs()
                    <= 4e-16 * exact.abs().max(1e-300) + 3e-16 * f64::from(u8::from(exact.abs() <= 1.0));
                assert!(
                    found == exact || (found.is_nan() && exact.is_nan()) || is_near,
                    "{op:?}({x}): {found} {exact}"
                );
            }
        }
    }
}
