//! Why vertices make no polygon.

use core::fmt;

/// Why some vertices are no polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PolygonError {
    /// Fewer than three or more than four vertices.
    VertexCount,
    /// A coordinate is NaN, infinite, or so large that areas overflow.
    NotFinite,
    /// The area is zero to within rounding.
    ZeroArea,
    /// A vertex lies off the plane of the others.
    NonPlanar,
    /// The outline turns the wrong way at a vertex, or crosses itself.
    Concave,
}

impl fmt::Display for PolygonError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::VertexCount => "a polygon has three or four vertices",
            Self::NotFinite => "a coordinate is not a finite number (or its square overflows)",
            Self::ZeroArea => "the area is zero",
            Self::NonPlanar => "the vertices do not lie in one plane",
            Self::Concave => "the polygon is not convex",
        })
    }
}

impl core::error::Error for PolygonError {}
