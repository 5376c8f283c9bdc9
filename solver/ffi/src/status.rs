//! What functions return, and the checks of pointers that they share.

use core::slice;

use relume::atlas::AtlasError;
use relume::relight::RelightError;

/// How a call ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub enum RelumeStatus {
    /// All is well.
    Ok = 0,
    /// A pointer is null.
    Null = 1,
    /// A pointer is not aligned for its type.
    Alignment = 2,
    /// A length does not fit the atlas.
    Length = 3,
    /// An atlas or a frame was not made by this library.
    NotMade = 4,
    /// The bytes are not an atlas.
    NotAnAtlas = 5,
    /// The atlas is of a version that is not known here.
    Version = 6,
    /// The atlas is cut off, has bytes too many, or was damaged.
    Damaged = 7,
    /// The atlas holds something illegal.
    Illegal = 8,
    /// There is no such light.
    Light = 9,
    /// A weight is negative or not finite.
    Weight = 10,
    /// The mix is too bright, or the exposure is not positive or too large.
    Range = 11,
    /// The atlas is in codes that this function does not read.
    Code = 12,
}

impl From<AtlasError> for RelumeStatus {
    fn from(error: AtlasError) -> Self {
        match error {
            AtlasError::NotAnAtlas => Self::NotAnAtlas,
            AtlasError::Version(_) => Self::Version,
            AtlasError::Truncated { .. } | AtlasError::Oversized { .. } | AtlasError::Checksum => {
                Self::Damaged
            }
            _ => Self::Illegal,
        }
    }
}

impl From<RelightError> for RelumeStatus {
    fn from(error: RelightError) -> Self {
        match error {
            RelightError::Lights { .. } => Self::Light,
            RelightError::Mix { .. } => Self::Weight,
            RelightError::Range => Self::Range,
            RelightError::Code => Self::Code,
            _ => Self::Length,
        }
    }
}

/// The status of a result.
pub(crate) fn status(result: Result<(), RelumeStatus>) -> RelumeStatus {
    match result {
        Ok(()) => RelumeStatus::Ok,
        Err(status) => status,
    }
}

/// A pointer that is neither null nor badly aligned.
pub(crate) fn checked<T>(pointer: *const T) -> Result<*const T, RelumeStatus> {
    if pointer.is_null() {
        Err(RelumeStatus::Null)
    } else if !pointer.is_aligned() {
        Err(RelumeStatus::Alignment)
    } else {
        Ok(pointer)
    }
}

/// What a pointer points at.
///
/// # Safety
/// The rules of the crate.
pub(crate) unsafe fn shared<'a, T>(pointer: *const T) -> Result<&'a T, RelumeStatus> {
    // SAFETY: checked, and valid by the rules.
    Ok(unsafe { &*checked(pointer)? })
}

/// What a pointer points at, to write to.
///
/// # Safety
/// The rules of the crate.
pub(crate) unsafe fn exclusive<'a, T>(pointer: *mut T) -> Result<&'a mut T, RelumeStatus> {
    checked(pointer)?;
    // SAFETY: checked, and valid by the rules.
    Ok(unsafe { &mut *pointer })
}

/// So many values.
///
/// # Safety
/// The rules of the crate.
pub(crate) unsafe fn values<'a, T>(
    pointer: *const T,
    count: usize,
) -> Result<&'a [T], RelumeStatus> {
    let pointer = checked(pointer)?;
    check_size::<T>(count)?;
    // SAFETY: checked, and valid for so many by the rules.
    Ok(unsafe { slice::from_raw_parts(pointer, count) })
}

/// So many values to write to.
///
/// # Safety
/// The rules of the crate.
pub(crate) unsafe fn values_mut<'a, T>(
    pointer: *mut T,
    count: usize,
) -> Result<&'a mut [T], RelumeStatus> {
    checked(pointer)?;
    check_size::<T>(count)?;
    // SAFETY: checked, and valid for so many by the rules.
    Ok(unsafe { slice::from_raw_parts_mut(pointer, count) })
}

/// No more than an object of any language can have.
fn check_size<T>(count: usize) -> Result<(), RelumeStatus> {
    let bytes = count.checked_mul(size_of::<T>());
    match bytes.is_some_and(|bytes| isize::try_from(bytes).is_ok()) {
        true => Ok(()),
        false => Err(RelumeStatus::Length),
    }
}

/// Says that this library made something: `RELU` in ASCII.
pub(crate) const MADE: u32 = 0x5245_4c55;

/// Lets a struct of a mark and words hold a Rust value that C does not look into.
macro_rules! holds {
    ($name:ident, $inner:ty, $words:literal) => {
        const _: () = assert!(
            size_of::<$inner>() <= size_of::<[u64; $words]>()
                && align_of::<$inner>() <= align_of::<u64>()
        );

        impl $name {
            pub(crate) const fn new(value: $inner) -> Self {
                let mut words = core::mem::MaybeUninit::<[u64; $words]>::uninit();
                // SAFETY: it fits, as is asserted above. It is never dropped, and need not be.
                unsafe { words.as_mut_ptr().cast::<$inner>().write(value) };
                Self {
                    made: $crate::status::MADE,
                    words,
                }
            }

            /// The value.
            ///
            /// # Safety
            /// The rules of the crate.
            pub(crate) unsafe fn get(&self) -> Result<&$inner, $crate::status::RelumeStatus> {
                $crate::status::check_made(self.made)?;
                // SAFETY: `new` wrote one here, and what it borrows is still there by the rules.
                Ok(unsafe { &*self.words.as_ptr().cast::<$inner>() })
            }
        }
    };
}
pub(crate) use holds;

pub(crate) fn check_made(mark: u32) -> Result<(), RelumeStatus> {
    if mark == MADE {
        Ok(())
    } else {
        Err(RelumeStatus::NotMade)
    }
}
