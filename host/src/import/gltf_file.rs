//! The container of a glTF file: GLB chunks, version, required extensions.

use std::path::Path;

use serde::Deserialize;

use super::error::ImportError;

/// Extensions that a file may require. Those of materials that are not listed as unsupported are
/// fine as well: they change how a surface shines, not its base colour.
const SUPPORTED: [&str; 3] = [
    "KHR_lights_punctual",
    "KHR_texture_transform",
    "KHR_mesh_quantization",
];

/// A material extension that replaces the base colour.
const UNSUPPORTED_MATERIAL: &str = "KHR_materials_pbrSpecularGlossiness";

/// Bytes before the first chunk of a GLB file.
const GLB_HEADER: usize = 12;

/// The JSON text, and the binary part of a GLB file.
pub(super) fn split(path: &Path, bytes: &[u8]) -> Result<(Vec<u8>, Option<Vec<u8>>), ImportError> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes.to_vec(), None));
    }
    let cut_off = || ImportError::file(path, "the file is cut off; export or copy it again");
    // The crate subtracts the header from the length unchecked.
    let length = bytes.get(8..GLB_HEADER).ok_or_else(cut_off)?;
    let length = length
        .iter()
        .rev()
        .fold(0, |sum, byte| sum << 8 | usize::from(*byte));
    if length < GLB_HEADER {
        return Err(cut_off());
    }
    let glb = ::gltf::Glb::from_slice(bytes).map_err(|error| {
        ImportError::file(
            path,
            format_args!("no legal GLB: {error}; export or copy it again"),
        )
    })?;
    Ok((glb.json.into_owned(), glb.bin.map(|bin| bin.into_owned())))
}

/// What decides whether the rest can be understood.
#[derive(Deserialize)]
struct Requirements {
    asset: Asset,
    #[serde(default, rename = "extensionsRequired")]
    extensions: Vec<String>,
}

#[derive(Deserialize)]
struct Asset {
    version: String,
}

/// Refuses other versions, and extensions that a file requires and nobody here understands.
pub(super) fn check_requirements(path: &Path, text: &[u8]) -> Result<(), ImportError> {
    let Requirements { asset, extensions } = serde_json::from_slice(text).map_err(|error| {
        ImportError::file(
            path,
            format_args!("no legal glTF: {error}; export or copy it again"),
        )
    })?;
    if !asset.version.starts_with("2.") {
        let version = asset.version;
        return Err(ImportError::file(
            path,
            format_args!("glTF version {version:?}; export it as glTF 2.0"),
        ));
    }
    let is_supported = |name: &str| {
        let material = name.starts_with("KHR_materials_") && name != UNSUPPORTED_MATERIAL;
        material || SUPPORTED.contains(&name)
    };
    let unsupported: Vec<String> = extensions
        .iter()
        .filter(|name| !is_supported(name))
        .map(|name| format!("{name:?}"))
        .collect();
    if unsupported.is_empty() {
        return Ok(());
    }
    Err(ImportError::file(
        path,
        format_args!(
            "requires extensions that are not supported: {}; export it without them",
            unsupported.join(", ")
        ),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glb_headers_are_checked() {
        for bytes in [
            &b"glTF"[..],
            b"glTF\x02\0\0\0\x0b\0\0\0",
            b"glTF\x02\0\0\0\xff\xff\xff\xff",
        ] {
            assert!(split(Path::new("x"), bytes).is_err());
        }
    }
}
