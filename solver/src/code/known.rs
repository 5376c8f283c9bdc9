//! The codes that a program knows: a device carries no instructions and no tables for those that its atlas is not in.

use super::{Code, Curve, DECODED_BITS, Magnitude, decode_fixed};

/// A set of codes, by type: what it leaves out, the linker leaves out.
pub trait Known {
    /// Whether codes in tiles are among them.
    const TILES: bool;

    /// Whether a code is among them.
    fn knows(code: Code) -> bool;

    /// [`Curve::magnitude`] of the curves of these codes; those of others are taken for exponential.
    fn magnitude(curve: &Curve, code: u16) -> Magnitude;
}

/// Every code.
#[derive(Clone, Copy, Debug)]
pub struct AllCodes;

impl Known for AllCodes {
    const TILES: bool = true;

    fn knows(_: Code) -> bool {
        true
    }

    fn magnitude(curve: &Curve, code: u16) -> Magnitude {
        curve.magnitude(code)
    }
}

/// The exponential codes: [`Code::Exp8`], [`Code::Exp8s`] and [`Code::Lum8`].
#[derive(Clone, Copy, Debug)]
pub struct ExponentialCodes;

impl Known for ExponentialCodes {
    const TILES: bool = false;

    fn knows(code: Code) -> bool {
        matches!(code, Code::Exp8 | Code::Exp8s | Code::Lum8)
    }

    fn magnitude(_: &Curve, code: u16) -> Magnitude {
        let code = u8::try_from(code).unwrap_or(u8::MAX);
        Magnitude {
            mantissa: decode_fixed(code).into(),
            exponent: -(DECODED_BITS as i32),
        }
    }
}
