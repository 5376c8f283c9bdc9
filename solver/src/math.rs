//! Float functions of the solver; the only file that names libm.
//!
//! Every target calls the same pure-Rust code, so a host and a microcontroller get the same bits.
//! All arguments and results are `f32`; angles are in radians.

/// Square root; negative arguments that rounding produced count as zero.
#[must_use]
pub fn safe_sqrt(x: f32) -> f32 {
    libm::sqrtf(x.max(0.0))
}

/// `1 / sqrt(x)` of a normal number, to two roundings; finite at 0. Vectorises.
///
/// The bits of a float are a logarithm: half of them, negated, give a first value within 3.5 %
/// (Lomont 2003). A step of third order and one of Newton's follow.
#[inline]
#[must_use]
pub fn reciprocal_sqrt(x: f32) -> f32 {
    let near = f32::from_bits(0x5f37_59df - (x.to_bits() >> 1));
    let miss = 1.0 - x * near * near;
    let nearer = near + near * miss * (0.5 + 0.375 * miss);
    let miss = 1.0 - x * nearer * nearer;
    nearer + 0.5 * nearer * miss
}

/// `acos(x) / sqrt(1 - x^2)` for x in [0, 1]: an angle up to a right one over its sine, by its cosine.
/// Vectorises.
///
/// The polynomial of least largest error in `1 - x`: 1.1e-8, and a rounding on top.
#[inline]
#[must_use]
pub fn angle_over_sine(x: f32) -> f32 {
    const HIGHER: [f32; 9] = [
        -0.033_457_37,
        0.052_578_643,
        -0.035_150_833,
        0.030_985_637,
        0.019_848_704,
        0.058_037_702,
        0.133_260_89,
        0.333_335_58,
        1.0,
    ];
    let versine = 1.0 - x;
    HIGHER
        .iter()
        .fold(0.011_357_361, |sum, next| sum * versine + next)
}

/// `e^x`.
#[must_use]
pub fn exp(x: f32) -> f32 {
    libm::expf(x)
}

/// `e^x - 1`, exact near zero.
#[must_use]
pub fn exp_m1(x: f32) -> f32 {
    libm::expm1f(x)
}

/// Natural logarithm.
#[must_use]
pub fn ln(x: f32) -> f32 {
    libm::logf(x)
}

/// `ln(1 + x)`, exact near zero.
#[must_use]
pub fn ln_1p(x: f32) -> f32 {
    libm::log1pf(x)
}

/// `x^y`.
#[must_use]
pub fn pow(x: f32, y: f32) -> f32 {
    libm::powf(x, y)
}

/// Sine.
#[must_use]
pub fn sin(x: f32) -> f32 {
    libm::sinf(x)
}

/// Cosine.
#[must_use]
pub fn cos(x: f32) -> f32 {
    libm::cosf(x)
}

/// Tangent.
#[must_use]
pub fn tan(x: f32) -> f32 {
    libm::tanf(x)
}

/// Arc cosine; arguments that rounding pushed out of [-1, 1] are clamped.
#[must_use]
pub fn safe_acos(x: f32) -> f32 {
    libm::acosf(x.clamp(-1.0, 1.0))
}

/// Angle of the vector `(x, y)` to the x axis.
#[must_use]
pub fn atan2(y: f32, x: f32) -> f32 {
    libm::atan2f(y, x)
}

/// Nearest integer, halves away from zero.
#[must_use]
pub fn round(x: f32) -> f32 {
    libm::roundf(x)
}

/// Smallest integer that is not below `x`.
#[must_use]
pub fn ceil(x: f32) -> f32 {
    libm::ceilf(x)
}

/// Largest integer that is not above `x`.
#[must_use]
pub fn floor(x: f32) -> f32 {
    libm::floorf(x)
}

/// `x * 2^n`, exact but for overflow and underflow.
#[must_use]
pub fn scale_by_power_of_two(x: f32, n: i32) -> f32 {
    libm::scalbnf(x, n)
}

/// `(mantissa, exponent)` with `x = mantissa * 2^exponent` and a mantissa in [0.5, 1).
#[must_use]
pub fn split_exponent(x: f32) -> (f32, i32) {
    libm::frexpf(x)
}
