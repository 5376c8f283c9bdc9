//! Where a division puts its parts: anything that takes them, or storage of fixed capacity.

use core::fmt;

use heapless::Vec;

use super::{Element, Face, Mesh, Patch};

/// Why a scene was not divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MeshError {
    /// A spacing is not a positive finite length.
    Spacing,
    /// An edge of this surface needs more than 65 535 elements.
    TooFine {
        /// Number of the surface.
        surface: u32,
    },
    /// More faces than the storage holds.
    TooManyFaces {
        /// Capacity of the storage.
        limit: usize,
    },
    /// More patches than the storage holds.
    TooManyPatches {
        /// Capacity of the storage.
        limit: usize,
    },
    /// More elements than the storage holds.
    TooManyElements {
        /// Capacity of the storage.
        limit: usize,
    },
}

impl fmt::Display for MeshError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Spacing => f.write_str("patch and element lengths must be positive and finite"),
            Self::TooFine { surface } => write!(
                f,
                "surface {surface}: an edge needs more than 65535 elements"
            ),
            Self::TooManyFaces { limit } => {
                write!(f, "more faces than the storage holds ({limit})")
            }
            Self::TooManyPatches { limit } => {
                write!(f, "more patches than the storage holds ({limit})")
            }
            Self::TooManyElements { limit } => {
                write!(f, "more elements than the storage holds ({limit})")
            }
        }
    }
}

impl core::error::Error for MeshError {}

/// Where faces, patches and elements are put: one at a time, refused when full.
pub trait MeshSink {
    /// Takes a face.
    ///
    /// # Errors
    /// [`MeshError::TooManyFaces`].
    fn face(&mut self, face: Face) -> Result<(), MeshError>;
    /// Takes a patch.
    ///
    /// # Errors
    /// [`MeshError::TooManyPatches`].
    fn patch(&mut self, patch: Patch) -> Result<(), MeshError>;
    /// Takes an element.
    ///
    /// # Errors
    /// [`MeshError::TooManyElements`].
    fn element(&mut self, element: Element) -> Result<(), MeshError>;
}

/// Storage of fixed capacity, fit for a `static`. Patches that 16 bits cannot name do not compile:
///
/// ```compile_fail
/// let storage = relume::mesh::MeshStorage::<12, 65_537, 960>::new();
/// ```
///
/// ```
/// let storage = relume::mesh::MeshStorage::<12, 68, 960>::new();
/// ```
#[derive(Debug)]
pub struct MeshStorage<const FACES: usize, const PATCHES: usize, const ELEMENTS: usize> {
    faces: Vec<Face, FACES>,
    patches: Vec<Patch, PATCHES>,
    elements: Vec<Element, ELEMENTS>,
}

impl<const FACES: usize, const PATCHES: usize, const ELEMENTS: usize>
    MeshStorage<FACES, PATCHES, ELEMENTS>
{
    /// Empty storage. More than 65 536 patches do not compile.
    #[must_use]
    pub const fn new() -> Self {
        const {
            assert!(PATCHES <= 65_536, "patch ids of a device are 16 bits wide");
        }
        Self {
            faces: Vec::new(),
            patches: Vec::new(),
            elements: Vec::new(),
        }
    }

    /// What is stored.
    #[must_use]
    pub fn mesh(&self) -> Mesh<'_> {
        Mesh {
            faces: &self.faces,
            patches: &self.patches,
            elements: &self.elements,
        }
    }
}

impl<const FACES: usize, const PATCHES: usize, const ELEMENTS: usize> Default
    for MeshStorage<FACES, PATCHES, ELEMENTS>
{
    fn default() -> Self {
        Self::new()
    }
}

impl<const FACES: usize, const PATCHES: usize, const ELEMENTS: usize> MeshSink
    for MeshStorage<FACES, PATCHES, ELEMENTS>
{
    fn face(&mut self, face: Face) -> Result<(), MeshError> {
        let full = MeshError::TooManyFaces { limit: FACES };
        self.faces.push(face).map_err(|_| full)
    }

    fn patch(&mut self, patch: Patch) -> Result<(), MeshError> {
        let full = MeshError::TooManyPatches { limit: PATCHES };
        self.patches.push(patch).map_err(|_| full)
    }

    fn element(&mut self, element: Element) -> Result<(), MeshError> {
        let full = MeshError::TooManyElements { limit: ELEMENTS };
        self.elements.push(element).map_err(|_| full)
    }
}
