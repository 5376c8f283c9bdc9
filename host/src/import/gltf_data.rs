//! The binary side of a glTF file: buffers, accessors and encoded images.
//!
//! Everything is read here with its bounds checked, because the wrappers of the gltf crate panic
//! on accessors and references that its validation lets pass. Specification: glTF 2.0, 3.6.

use std::path::{Path, PathBuf};

use ::gltf::json;
use base64::Engine;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};
use json::accessor::{Accessor, ComponentType};
use json::validation::Checked;
use json::{Index, Root};

use super::error::{ImportError, read_named};
use crate::texture::Image;

/// Base64 of data URIs, whose padding exporters may leave out.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The buffers of a glTF file and what lies in them.
#[derive(Debug)]
pub(super) struct Data<'a> {
    root: &'a Root,
    folder: PathBuf,
    buffers: Vec<Vec<u8>>,
}

impl<'a> Data<'a> {
    /// Reads all buffers; `blob` is the binary part of a GLB file.
    ///
    /// # Errors
    /// A buffer that is missing, unreadable or shorter than the file says.
    pub fn load(
        path: &Path,
        root: &'a Root,
        mut blob: Option<Vec<u8>>,
    ) -> Result<Self, ImportError> {
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        let mut buffers = Vec::new();
        for (buffer, number) in root.buffers.iter().zip(0..) {
            let fault =
                |fault: String| ImportError::part(path, format_args!("buffer {number}"), fault);
            let bytes = match (&buffer.uri, blob.take()) {
                (Some(uri), kept) => {
                    blob = kept;
                    resource(&folder, uri).map_err(fault)?
                }
                (None, Some(blob)) if number == 0 => blob,
                _ => return Err(fault("has no data; export the file again".to_owned())),
            };
            if (bytes.len() as u64) < buffer.byte_length.0 {
                return Err(fault(format!(
                    "{} bytes instead of {}; the file is cut off, export or copy it again",
                    bytes.len(),
                    buffer.byte_length.0
                )));
            }
            buffers.push(bytes);
        }
        Ok(Self {
            root,
            folder,
            buffers,
        })
    }

    /// Positions or texture coordinates; integers are normalised if the accessor says so.
    pub fn vectors<const N: usize>(
        &self,
        number: Index<Accessor>,
    ) -> Result<Vec<[f32; N]>, String> {
        let normalized = self
            .root
            .get(number)
            .is_some_and(|accessor| accessor.normalized);
        self.values(number, N, [0.0; N], |kind, bytes| {
            let mut vector = [0.0; N];
            for (slot, bytes) in vector.iter_mut().zip(bytes.chunks_exact(kind.size())) {
                *slot = component(kind, normalized, bytes)?;
            }
            Some(vector)
        })
    }

    /// Vertex numbers.
    pub fn indices(&self, number: Index<Accessor>) -> Result<Vec<u32>, String> {
        self.values(number, 1, 0, unsigned)
    }

    /// The image with a number, decoded; `None` when it is missing or damaged.
    pub fn image(&self, number: Index<json::Image>) -> Option<Image> {
        let image = self.root.get(number)?;
        match (image.buffer_view, &image.uri) {
            (Some(view), _) => Image::decode(self.view(view)?).ok(),
            (None, Some(uri)) => Image::decode(&resource(&self.folder, uri).ok()?).ok(),
            (None, None) => None,
        }
    }

    /// The elements of an accessor, sparse ones included.
    fn values<T: Copy>(
        &self,
        number: Index<Accessor>,
        components: usize,
        zero: T,
        decode: impl Fn(ComponentType, &[u8]) -> Option<T>,
    ) -> Result<Vec<T>, String> {
        let fault =
            |what: &str| format!("accessor {} {what}; export the file again", number.value());
        let accessor = self
            .root
            .get(number)
            .ok_or_else(|| fault("does not exist"))?;
        let (Checked::Valid(kind), Checked::Valid(shape)) =
            (accessor.component_type, accessor.type_)
        else {
            return Err(fault("has an unknown type"));
        };
        if shape.multiplicity() != components {
            return Err(fault("has the wrong number of components"));
        }
        let size = kind.0.size() * components;
        let beyond = || fault("reaches beyond its buffer view");
        let wrong_kind = || fault("has the wrong component type");

        let offset = accessor.byte_offset.unwrap_or_default().0;
        let mut values = match accessor.buffer_view {
            Some(view) => {
                let elements = self.elements(view, offset, accessor.count.0, size);
                let decoded = elements
                    .ok_or_else(beyond)?
                    .map(|bytes| decode(kind.0, bytes));
                decoded.collect::<Option<Vec<T>>>().ok_or_else(wrong_kind)?
            }
            // All zero; with more elements than the whole file has bytes it is damaged.
            None => {
                let bytes: usize = self.buffers.iter().map(Vec::len).sum();
                let count = usize::try_from(accessor.count.0)
                    .ok()
                    .filter(|count| *count <= bytes);
                vec![zero; count.ok_or_else(beyond)?]
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let Checked::Valid(index_kind) = sparse.indices.component_type else {
                return Err(fault("has an unknown index type"));
            };
            let (at, new) = (&sparse.indices, &sparse.values);
            let count = sparse.count.0;
            let places =
                self.elements(at.buffer_view, at.byte_offset.0, count, index_kind.0.size());
            let changes = self.elements(new.buffer_view, new.byte_offset.0, count, size);
            for (place, bytes) in places.ok_or_else(beyond)?.zip(changes.ok_or_else(beyond)?) {
                let place = unsigned(index_kind.0, place).ok_or_else(wrong_kind)?;
                let slot = values.get_mut(place as usize).ok_or_else(beyond)?;
                *slot = decode(kind.0, bytes).ok_or_else(wrong_kind)?;
            }
        }
        Ok(values)
    }

    /// Evenly spaced elements of a buffer view; `None` when they reach beyond it.
    fn elements(
        &self,
        view: Index<json::buffer::View>,
        offset: u64,
        count: u64,
        size: usize,
    ) -> Option<impl Iterator<Item = &[u8]>> {
        let bytes = self.view(view)?;
        let stride = self.root.get(view)?.byte_stride.map(|stride| stride.0);
        let stride = stride.filter(|stride| *stride > 0).unwrap_or(size);
        let (offset, count) = (usize::try_from(offset).ok()?, usize::try_from(count).ok()?);
        if let Some(before_last) = count.checked_sub(1) {
            let last = before_last.checked_mul(stride)?.checked_add(offset)?;
            bytes.get(last..last.checked_add(size)?)?;
        }
        let starts = (0..count).map(move |i| offset + i * stride);
        Some(starts.filter_map(move |start| bytes.get(start..start + size)))
    }

    fn view(&self, number: Index<json::buffer::View>) -> Option<&[u8]> {
        let view = self.root.get(number)?;
        let start = usize::try_from(view.byte_offset.unwrap_or_default().0).ok()?;
        let end = start.checked_add(usize::try_from(view.byte_length.0).ok()?)?;
        self.buffers.get(view.buffer.value())?.get(start..end)
    }
}

/// One number of a vector (glTF 2.0, 3.11 for normalised integers).
fn component(kind: ComponentType, normalized: bool, bytes: &[u8]) -> Option<f32> {
    let (value, largest) = match (kind, bytes) {
        (ComponentType::F32, &[a, b, c, d]) => return Some(f32::from_le_bytes([a, b, c, d])),
        (ComponentType::I8, &[a]) => (f32::from(i8::from_le_bytes([a])), f32::from(i8::MAX)),
        (ComponentType::U8, &[a]) => (f32::from(a), f32::from(u8::MAX)),
        (ComponentType::I16, &[a, b]) => {
            (f32::from(i16::from_le_bytes([a, b])), f32::from(i16::MAX))
        }
        (ComponentType::U16, &[a, b]) => {
            (f32::from(u16::from_le_bytes([a, b])), f32::from(u16::MAX))
        }
        _ => return None,
    };
    Some(if normalized {
        (value / largest).max(-1.0)
    } else {
        value
    })
}

/// A vertex number.
fn unsigned(kind: ComponentType, bytes: &[u8]) -> Option<u32> {
    match (kind, bytes) {
        (ComponentType::U8, &[a]) => Some(a.into()),
        (ComponentType::U16, &[a, b]) => Some(u16::from_le_bytes([a, b]).into()),
        (ComponentType::U32, &[a, b, c, d]) => Some(u32::from_le_bytes([a, b, c, d])),
        _ => None,
    }
}

/// What a URI stands for: data inside it, or a file beside the scene.
fn resource(folder: &Path, uri: &str) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let encoded = data
            .split_once(',')
            .filter(|(head, _)| head.ends_with(";base64"));
        let (_, encoded) = encoded.ok_or("its data URI is not base64; export the file again")?;
        return BASE64
            .decode(encoded)
            .map_err(|error| format!("its data URI is damaged ({error}); export the file again"));
    }
    if uri.contains("://") {
        return Err(format!("{uri:?} is no file; put the data beside the scene"));
    }
    let path = folder.join(percent_decoded(uri));
    read_named(&path).map_err(|error| format!("{} cannot be read: {error}", path.display()))
}

/// A relative URI as a file name (RFC 3986, 2.1).
fn percent_decoded(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        let code = after.get(..2).filter(|_| byte == b'%');
        let code = code.and_then(|digits| std::str::from_utf8(digits).ok());
        if let Some(decoded) = code.and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            bytes.push(decoded);
            rest = after.get(2..).unwrap_or_default();
        } else {
            bytes.push(byte);
            rest = after;
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    const BYTES: [u8; 16] = [1, 0, 2, 0, 255, 255, 0, 128, 0, 0, 128, 63, 0, 0, 0, 64];

    fn root(accessor: &str) -> Root {
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":16}}],"bufferViews":[
            {{"buffer":0,"byteLength":16}},{{"buffer":0,"byteOffset":8,"byteLength":8}},
            {{"buffer":0,"byteOffset":10,"byteLength":8}},{{"buffer":0,"byteLength":16,"byteStride":4}}],
            "accessors":[{accessor}]}}"#
        );
        Root::from_str(&text).unwrap()
    }

    fn with<T>(accessor: &str, read: impl Fn(&Data) -> Result<T, String>) -> Result<T, String> {
        let root = root(accessor);
        read(&Data::load(Path::new("x.glb"), &root, Some(BYTES.to_vec())).unwrap())
    }

    #[test]
    fn accessors_are_read_with_offset_stride_and_type() {
        let floats = r#"{"bufferView":1,"componentType":5126,"count":1,"type":"VEC2"}"#;
        assert_eq!(
            with(floats, |d| d.vectors::<2>(Index::new(0))),
            Ok(vec![[1.0, 2.0]])
        );
        let shorts =
            r#"{"bufferView":0,"byteOffset":4,"componentType":5123,"count":2,"type":"SCALAR"}"#;
        assert_eq!(
            with(shorts, |d| d.indices(Index::new(0))),
            Ok(vec![65535, 32768])
        );
        let strided = r#"{"bufferView":3,"componentType":5121,"count":4,"type":"SCALAR"}"#;
        assert_eq!(
            with(strided, |d| d.indices(Index::new(0))),
            Ok(vec![1, 255, 0, 0])
        );
        let normal =
            r#"{"bufferView":0,"componentType":5121,"normalized":true,"count":3,"type":"VEC2"}"#;
        let values = with(normal, |d| d.vectors::<2>(Index::new(0))).unwrap();
        assert_eq!(values[2], [1.0, 1.0]);
        let signed =
            r#"{"bufferView":0,"byteOffset":4,"componentType":5122,"count":1,"type":"VEC2"}"#;
        assert_eq!(
            with(signed, |d| d.vectors::<2>(Index::new(0))),
            Ok(vec![[-1.0, -32768.0]])
        );
    }

    #[test]
    fn sparse_accessors_change_zeros_or_a_view() {
        let sparse = r#"{"componentType":5126,"count":3,"type":"VEC2","sparse":{"count":1,
            "indices":{"bufferView":0,"byteOffset":2,"componentType":5123},"values":{"bufferView":1}}}"#;
        let values = with(sparse, |d| d.vectors::<2>(Index::new(0)));
        assert_eq!(values, Ok(vec![[0.0; 2], [0.0; 2], [1.0, 2.0]]));
    }

    #[test]
    fn wild_accessors_are_errors() {
        let huge = u64::MAX;
        let cases = [
            r#"{"bufferView":0,"componentType":5126,"count":3,"type":"VEC2"}"#.to_owned(),
            r#"{"bufferView":9,"componentType":5126,"count":1,"type":"VEC2"}"#.to_owned(),
            r#"{"bufferView":2,"componentType":5126,"count":1,"type":"VEC2"}"#.to_owned(),
            r#"{"bufferView":0,"componentType":5126,"count":1,"type":"VEC3"}"#.to_owned(),
            r#"{"bufferView":0,"componentType":1,"count":1,"type":"VEC2"}"#.to_owned(),
            r#"{"bufferView":0,"componentType":5125,"count":1,"type":"VEC2"}"#.to_owned(),
            format!(r#"{{"bufferView":0,"componentType":5126,"count":{huge},"type":"VEC2"}}"#),
            format!(r#"{{"componentType":5126,"count":{huge},"type":"VEC2"}}"#),
            format!(
                r#"{{"bufferView":0,"byteOffset":{huge},"componentType":5126,"count":1,"type":"VEC2"}}"#
            ),
        ];
        for accessor in cases {
            let fault = with(&accessor, |d| d.vectors::<2>(Index::new(0))).unwrap_err();
            assert!(fault.starts_with("accessor 0 "), "{accessor}: {fault}");
        }
        assert!(
            with("", |d| d.indices(Index::new(7)))
                .unwrap_err()
                .contains("does not exist")
        );
    }

    #[test]
    fn uris_are_data_or_files() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a b%.bin"), [7]).unwrap();
        let get = |uri: &str| resource(folder.path(), uri);
        assert_eq!(get("a%20b%25.bin"), Ok(vec![7]));
        assert_eq!(get("a b%.bin"), Ok(vec![7]));
        assert_eq!(
            get("data:application/octet-stream;base64,AQI="),
            Ok(vec![1, 2])
        );
        assert_eq!(get("data:;base64,AQI"), Ok(vec![1, 2]));
        for bad in [
            "data:text/plain,x",
            "data:;base64,*",
            "http://x/y",
            "none.bin",
            "/dev/zero",
            "%",
            "",
        ] {
            assert!(get(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn short_and_missing_buffers_are_named() {
        let root = root("");
        let error = Data::load(Path::new("x.glb"), &root, Some(vec![0; 15])).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("x.glb, buffer 0: 15 bytes instead of 16")
        );
        assert!(Data::load(Path::new("x.gltf"), &root, None).is_err());
    }
}
