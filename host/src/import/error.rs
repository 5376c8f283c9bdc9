//! Why a file was refused: always one line with the file, the place in it and what to do.

use std::path::{Path, PathBuf};
use std::{fs, io};

use super::assemble::MAX_LIGHTS;
use super::draft::MAX_POLYGONS;

/// Why nothing was imported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The file cannot be read at all.
    #[error("{}: cannot be read: {source}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The extension is not that of a scene.
    #[error("{}: not a known kind of scene; give a .obj, .gltf or .glb file", .path.display())]
    Kind {
        /// The file.
        path: PathBuf,
    },
    /// The file as a whole is unusable.
    #[error("{}: {fault}", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        fault: String,
    },
    /// A line of a text file is wrong.
    #[error("{}, line {line}: {fault}", .path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// What is wrong, and what to do.
        fault: String,
    },
    /// A named or numbered part of the file is wrong: a material, a node, a mesh, an entry.
    #[error("{}, {part}: {fault}", .path.display())]
    Part {
        /// The file.
        path: PathBuf,
        /// The part, as `material "wall"`.
        part: String,
        /// What is wrong, and what to do.
        fault: String,
    },
    /// The file holds no face that can reflect, block or emit.
    #[error("{}: no usable face; a scene needs at least one polygon with an area", .path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The file holds more polygons than can be handled.
    #[error(
        "{}: more than {MAX_POLYGONS} polygons; simplify the scene or split it",
        .path.display()
    )]
    TooManyPolygons {
        /// The file.
        path: PathBuf,
    },
    /// There are more lights than tags.
    #[error(
        "{}: {lights} lights, but at most {MAX_LIGHTS} fit; give lights that are switched together \
         the same name",
        .path.display()
    )]
    TooManyLights {
        /// The file.
        path: PathBuf,
        /// How many there are.
        lights: usize,
    },
}

impl ImportError {
    pub(super) fn file(path: &Path, fault: impl ToString) -> Self {
        Self::File {
            path: path.to_owned(),
            fault: fault.to_string(),
        }
    }

    pub(super) fn line(path: &Path, line: usize, fault: impl ToString) -> Self {
        Self::Line {
            path: path.to_owned(),
            line,
            fault: fault.to_string(),
        }
    }

    pub(super) fn part(path: &Path, part: impl ToString, fault: impl ToString) -> Self {
        Self::Part {
            path: path.to_owned(),
            part: part.to_string(),
            fault: fault.to_string(),
        }
    }
}

/// The bytes of a file.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, ImportError> {
    fs::read(path).map_err(|source| ImportError::Read {
        path: path.to_owned(),
        source,
    })
}

/// The bytes of a file that a scene names.
///
/// # Errors
/// Whatever the file system says; devices and pipes, which may never end, are no files.
pub(super) fn read_named(path: &Path) -> io::Result<Vec<u8>> {
    if fs::metadata(path)?.is_file() {
        fs::read(path)
    } else {
        Err(io::Error::other("it is no plain file"))
    }
}

/// The text of a file.
pub(super) fn read_text(path: &Path) -> Result<String, ImportError> {
    String::from_utf8(read(path)?).map_err(|error| {
        let end = error.utf8_error().valid_up_to();
        let before = error.as_bytes().iter().take(end);
        let line = 1 + before.filter(|byte| **byte == b'\n').count();
        ImportError::line(path, line, "not UTF-8 text; save the file as UTF-8")
    })
}
