//! The bytes of a `.rows` file: where the rays of a bake ended, for the next bake of the same mesh.
//!
//! Version 1, little-endian: `RELUMERO`, `u32` version, `u32` checksum of the mesh
//! ([`crate::solution::mesh_checksum`]), `u32` elements, `u32` passes; then for every pass 16 `u32` for
//! each element, the number of the element that a ray hit, `u32::MAX` for none, or `u32::MAX - 1` for a
//! ray in the dark; and a CRC-32 (ISO-HDLC) of everything before it, `u32`.

use crc::{CRC_32_ISO_HDLC, Crc};
use thiserror::Error;

use super::{DARK, Hits, NOTHING, RAYS_PER_PASS};

/// How a rows file starts.
pub const MAGIC: [u8; 8] = *b"RELUMERO";
const VERSION: u32 = 1;
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Why bytes are not the rows that were asked for.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum RowsError {
    /// The bytes do not start like rows.
    #[error("these are no rows; make them with `relume bake --keep-rows`")]
    NotRows,
    /// Written in another version of the format than this one knows.
    #[error("rows of version {0} are not of the {VERSION} known here; bake again with --keep-rows")]
    Version(u32),
    /// The length is not what the header says, or the checksum does not match.
    #[error("the rows are damaged; bake again with --keep-rows, or copy the file again")]
    Damaged,
    /// They belong to another mesh.
    #[error("the rows belong to another mesh; give those that were kept with the solution")]
    OtherMesh,
}

/// Rows as bytes; `mesh` is the checksum of the mesh that they belong to.
#[must_use]
pub fn write(hits: &Hits, mesh: u32, elements: usize) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    let passes = hits.passes.len() as u32;
    for value in [VERSION, mesh, elements as u32, passes] {
        bytes.extend(value.to_le_bytes());
    }
    for hit in hits.passes.iter().flatten() {
        bytes.extend(hit.to_le_bytes());
    }
    bytes.extend(CRC.checksum(&bytes).to_le_bytes());
    bytes
}

/// Rows from bytes, for the mesh with this checksum and so many elements.
///
/// # Errors
/// [`RowsError`] for anything that [`write()`] does not write for it.
pub fn read(bytes: &[u8], mesh: u32, elements: usize) -> Result<Hits, RowsError> {
    let rest = bytes.strip_prefix(&MAGIC).ok_or(RowsError::NotRows)?;
    let (words, []) = rest.as_chunks::<4>() else {
        return Err(RowsError::Damaged);
    };
    let mut words = words.iter().map(|word| u32::from_le_bytes(*word));
    let mut next = || words.next().ok_or(RowsError::Damaged);
    let version = next()?;
    if version != VERSION {
        return Err(RowsError::Version(version));
    }
    let (own_mesh, own_elements, passes) = (next()?, next()?, next()?);
    let per_pass = (own_elements as usize).saturating_mul(RAYS_PER_PASS as usize);
    let mut hits: Vec<u32> = words.collect();
    let checksum = hits.pop().ok_or(RowsError::Damaged)?;
    if hits.len() != per_pass.saturating_mul(passes as usize)
        || CRC.checksum(&bytes[..bytes.len() - 4]) != checksum
        || hits
            .iter()
            .any(|hit| *hit >= own_elements && !matches!(*hit, NOTHING | DARK))
    {
        return Err(RowsError::Damaged);
    }
    if own_mesh != mesh || own_elements as usize != elements {
        return Err(RowsError::OtherMesh);
    }
    Ok(Hits {
        passes: hits.chunks(per_pass.max(1)).map(<[u32]>::to_vec).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_read_and_what_was_damaged_is_not() {
        let pass = |shift: u32| (0..32).map(|i| (i * 7 + shift) % 2).collect();
        let hits = Hits {
            passes: vec![pass(0), pass(1), vec![NOTHING; 32], vec![DARK; 32]],
        };
        let bytes = write(&hits, 77, 2);
        assert_eq!(read(&bytes, 77, 2).unwrap().passes, hits.passes);
        assert_eq!(read(&bytes, 78, 2).unwrap_err(), RowsError::OtherMesh);
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length], 77, 2).is_err(), "{length} bytes");
        }
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x11;
            assert!(read(&damaged, 77, 2).is_err(), "byte {at}");
        }
    }
}
