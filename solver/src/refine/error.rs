//! What can go wrong in a refinement.

use core::fmt;

/// Why a refinement cannot start or go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RefineError {
    /// More lights than the blocks hold.
    TooManyLights {
        /// Capacity of the storage.
        limit: usize,
    },
    /// More elements than the storage holds.
    TooManyElements {
        /// Capacity of the storage.
        limit: usize,
    },
    /// More patches than the storage holds.
    TooManyPatches {
        /// Capacity of the storage.
        limit: usize,
    },
    /// The wanted residual is not a positive number.
    Residual,
    /// The importance of this light is not a positive finite number.
    Importance {
        /// Its tag.
        light: u32,
    },
    /// There is no such patch or light.
    Unknown,
    /// A row does not have one factor in [0, 1] per element.
    Row {
        /// The first element whose factor is missing or illegal.
        element: usize,
    },
}

impl fmt::Display for RefineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooManyLights { limit } => {
                write!(f, "more lights than the storage holds ({limit})")
            }
            Self::TooManyElements { limit } => {
                write!(f, "more elements than the storage holds ({limit})")
            }
            Self::TooManyPatches { limit } => {
                write!(f, "more patches than the storage holds ({limit})")
            }
            Self::Residual => f.write_str("the residual to reach must be a positive number"),
            Self::Importance { light } => {
                write!(f, "light {light}: the importance must be a positive number")
            }
            Self::Unknown => f.write_str("there is no such patch or light"),
            Self::Row { element } => {
                write!(f, "element {element}: no legal factor in this row")
            }
        }
    }
}

impl core::error::Error for RefineError {}
