//! The codes that a program knows: a device carries no instructions and no tables for those that its atlas is not in.

use super::{Code, Curve, DECODED_BITS, Magnitude, decode_fixed};

/// A set of codes, by type: what it leaves out, the linker leaves out.
pub trait Known {
    /// Whether these are only the exponential codes: [`Code::Exp8`], [`Code::Exp8s`] and [`Code::Lum8`].
    const ONLY_EXPONENTIAL: bool;

    /// Whether a code is among them.
    #[must_use]
    fn knows(code: Code) -> bool {
        !Self::ONLY_EXPONENTIAL || matches!(code, Code::Exp8 | Code::Exp8s | Code::Lum8)
    }

    /// [`Curve::magnitude`] of the curves of these codes.
    #[must_use]
    fn magnitude(curve: &Curve, code: u16) -> Magnitude {
        if Self::ONLY_EXPONENTIAL {
            exponential(code)
        } else {
            curve.magnitude(code)
        }
    }
}

/// Every code.
#[derive(Clone, Copy, Debug)]
pub struct AllCodes;

impl Known for AllCodes {
    const ONLY_EXPONENTIAL: bool = false;
}

/// The exponential codes.
#[derive(Clone, Copy, Debug)]
pub struct ExponentialCodes;

impl Known for ExponentialCodes {
    const ONLY_EXPONENTIAL: bool = true;
}

/// The value of an exponential code, in scales.
pub(super) fn exponential(code: u16) -> Magnitude {
    let code = u8::try_from(code).unwrap_or(u8::MAX);
    Magnitude {
        mantissa: decode_fixed(code).into(),
        exponent: -(DECODED_BITS as i32),
    }
}
