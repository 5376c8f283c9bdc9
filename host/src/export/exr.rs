//! OpenEXR pictures: one linear picture, or one picture with a layer per light.
//!
//! A layer per light is written as Blender writes light groups: one part, with the channels
//! `ViewLayer.Combined_NAME.R`, `.G` and `.B` in 32-bit float. Reading also takes `.A` (coverage, 1
//! without it), half floats, any name in place of `ViewLayer` or none, and files that hold each
//! layer in a part of that name with plain channels. A bare `Combined` is the sum of all lights and
//! none itself. Values are linear and unexposed, colours multiplied by the coverage; lights come
//! sorted by name, because the format sorts channels.
//!
//! References: OpenEXR, "Technical Introduction" (layers are name prefixes) and "Multi-part".

use std::collections::BTreeMap;
use std::io::{self, Cursor};
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};

use ::exr::block;
use ::exr::image::read::{image::ReadLayers, layers::ReadChannels, read};
use ::exr::image::write::WritableImage;
use ::exr::image::{AnyChannel, AnyChannels, Encoding, FlatImage, FlatSamples, Image, Layer};
use ::exr::math::Vec2;
use ::exr::meta::attribute::Text;
use ::exr::meta::header::{Header, LayerAttributes};

use crate::picture::LinearImage;

/// What comes before the light's name in the name of its layer.
const LIGHT: &str = "Combined_";
/// The view layer that is written, Blender's default.
const VIEW_LAYER: &str = "ViewLayer";
/// The channels of a layer.
const CHANNELS: [&str; 4] = ["R", "G", "B", "A"];
/// Largest side of a picture that is read.
const MAX_SIDE: usize = 16_384;
/// Most samples that a file may ask for: 4 GiB of them.
const MAX_SAMPLES: usize = 1 << 30;
/// Longest name of a channel, in bytes.
const MAX_NAME: usize = 255;

/// The name of a light and its part of the picture.
pub type LightLayer = (String, LinearImage);

/// What is wrong with a file or with what should become one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExrFault {
    /// The file system refused.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Damaged, truncated, of another format or of a kind that is not supported.
    #[error("no readable OpenEXR picture ({0}); write it again")]
    Format(String),
    /// Larger than any picture that is sensible here.
    #[error(
        "a side above {MAX_SIDE} pixels, or more than {MAX_SAMPLES} samples; render it smaller"
    )]
    TooLarge,
    /// There is no layer of a light.
    #[error("no layer is named *.{LIGHT}NAME; render with light groups")]
    NoLights,
    /// A layer is no complete RGB picture.
    #[error("the layer of light `{light}` has no channel {channel}; write red, green and blue")]
    MissingChannel {
        /// Name of the light.
        light: String,
        /// Name of the channel.
        channel: &'static str,
    },
    /// A light has two layers.
    #[error("light `{0}` has two layers; rename one")]
    Duplicate(String),
    /// A light's picture differs in size from the first one's.
    #[error("the layer of light `{0}` differs in size from the others; render all at one size")]
    SizeMismatch(String),
    /// A name that the format cannot hold.
    #[error("the light name `{0}` is empty, too long or holds a zero byte; rename it")]
    Name(String),
}

/// A fault and the file that it was found in.
#[derive(Debug, thiserror::Error)]
#[error("{}: {fault}", path.display())]
pub struct ExrError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub fault: ExrFault,
}

impl From<::exr::error::Error> for ExrFault {
    fn from(error: ::exr::error::Error) -> Self {
        Self::Format(error.to_string())
    }
}

/// The three colour channels of a picture, their names behind a prefix.
fn rgb(image: &LinearImage, prefix: &str) -> [AnyChannel<FlatSamples>; 3] {
    [0, 1, 2].map(|channel| {
        let name = format!("{prefix}{}", CHANNELS[channel]);
        let values = image.pixels.iter().map(|pixel| pixel[channel]);
        AnyChannel::new(
            Text::from_slice_unchecked(name.as_bytes()),
            FlatSamples::F32(values.collect()),
        )
    })
}

/// A file of one part. It is made on one thread: the same picture gives the same bytes.
fn encode(size: &LinearImage, channels: Vec<AnyChannel<FlatSamples>>) -> Result<Vec<u8>, ExrFault> {
    let layer = Layer::new(
        (size.width as usize, size.height as usize),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels.into()),
    );
    let mut bytes = Cursor::new(Vec::new());
    let image = Image::from_layer(layer);
    image.write().non_parallel().to_buffered(&mut bytes)?;
    Ok(bytes.into_inner())
}

/// The file of one linear picture: channels R, G, B in 32-bit float, black where nothing is.
///
/// # Errors
/// [`ExrFault::Format`] for a picture without pixels.
pub fn encode_rgb(image: &LinearImage) -> Result<Vec<u8>, ExrFault> {
    encode(image, rgb(image, "").to_vec())
}

/// The file of one picture with a layer per light.
///
/// # Errors
/// [`ExrFault`]: no light, sizes that differ, or a name that is taken or cannot be written.
pub fn encode_light_layers(layers: &[LightLayer]) -> Result<Vec<u8>, ExrFault> {
    let (_, first) = layers.first().ok_or(ExrFault::NoLights)?;
    let mut channels = Vec::new();
    for (index, (light, image)) in layers.iter().enumerate() {
        let prefix = format!("{VIEW_LAYER}.{LIGHT}{light}.");
        if light.is_empty() || light.contains('\0') || prefix.len() >= MAX_NAME {
            return Err(ExrFault::Name(light.clone()));
        }
        if layers[..index].iter().any(|other| other.0 == *light) {
            return Err(ExrFault::Duplicate(light.clone()));
        }
        if (image.width, image.height) != (first.width, first.height) {
            return Err(ExrFault::SizeMismatch(light.clone()));
        }
        channels.extend(rgb(image, &prefix));
    }
    encode(first, channels)
}

/// Reads the layers of all lights, sorted by name.
///
/// Nothing is said about the values: what rendered them may have left negative ones or NaN.
///
/// # Errors
/// [`ExrError`]: the file is damaged, too large, or has no layer of a light.
pub fn read_light_layers(path: &Path) -> Result<Vec<LightLayer>, ExrError> {
    let bytes = std::fs::read(path).map_err(ExrFault::Io);
    let layers = bytes.and_then(|bytes| decode_light_layers(&bytes));
    layers.map_err(|fault| ExrError {
        path: path.to_owned(),
        fault,
    })
}

fn decode_light_layers(bytes: &[u8]) -> Result<Vec<LightLayer>, ExrFault> {
    let image = decode(bytes)?;
    let mut lights: BTreeMap<String, Channels> = BTreeMap::new();
    for layer in &image.layer_data {
        let part = layer.attributes.layer_name.as_ref();
        for channel in &layer.channel_data.list {
            if let Some((light, component)) = light_channel(part, &channel.name) {
                let own = lights.entry(light.clone()).or_insert_with(|| Channels {
                    size: layer.size,
                    samples: [None; 4],
                });
                own.add(component, layer.size, &channel.sample_data, light)?;
            }
        }
    }

    let size = lights.values().next().ok_or(ExrFault::NoLights)?.size;
    let layers = lights.into_iter().map(|(light, channels)| {
        if channels.size != size {
            return Err(ExrFault::SizeMismatch(light));
        }
        channels.collect(light)
    });
    layers.collect()
}

/// All parts and channels of a file, its largest resolution only.
fn decode(bytes: &[u8]) -> Result<FlatImage, ExrFault> {
    let decoded = panic::catch_unwind(AssertUnwindSafe(|| {
        let chunks = block::read(Cursor::new(bytes), false)?;
        check_headers(chunks.headers())?;
        let reader = read().no_deep_data().largest_resolution_level();
        let reader = reader.all_channels().all_layers().all_attributes();
        Ok(reader.non_parallel().from_chunks(chunks)?)
    }));
    // The decoder promises errors; a damaged file that makes it panic all the same is one, too.
    decoded.unwrap_or_else(|_| Err(ExrFault::Format("damaged".to_owned())))
}

/// Refuses what the decoder would not refuse before it allocates, and what it would misread.
fn check_headers(headers: &[Header]) -> Result<(), ExrFault> {
    let mut samples: usize = 0;
    for header in headers {
        let Vec2(width, height) = header.layer_size;
        let area = width.saturating_mul(height);
        let own = area.saturating_mul(header.channels.list.len());
        samples = samples.saturating_add(own);
        if width > MAX_SIDE || height > MAX_SIDE || samples > MAX_SAMPLES {
            return Err(ExrFault::TooLarge);
        }
        let channels = &header.channels.list;
        if header.deep || channels.iter().any(|c| c.sampling != Vec2(1, 1)) {
            let kind = "deep and subsampled pictures are not supported";
            return Err(ExrFault::Format(kind.to_owned()));
        }
    }
    Ok(())
}

/// The light that a channel belongs to and which of [`CHANNELS`] it is; `None` for all others.
fn light_channel(part: Option<&Text>, channel: &Text) -> Option<(String, usize)> {
    let text = |text: &Text| String::from_utf8_lossy(text.as_slice()).into_owned();
    let name = text(channel);
    let full = match part {
        Some(part) if !name.contains('.') => format!("{}.{name}", text(part)),
        _ => name,
    };
    let (layer, component) = full.rsplit_once('.')?;
    let component = CHANNELS.iter().position(|c| *c == component)?;
    let inner = layer
        .split_once(&format!(".{LIGHT}"))
        .map(|(_, light)| light);
    let light = layer.strip_prefix(LIGHT).or(inner)?;
    (!light.is_empty()).then(|| (light.to_owned(), component))
}

/// The channels of one light as they are found.
struct Channels<'a> {
    size: Vec2<usize>,
    samples: [Option<&'a FlatSamples>; 4],
}

impl<'a> Channels<'a> {
    fn add(
        &mut self,
        component: usize,
        size: Vec2<usize>,
        samples: &'a FlatSamples,
        light: String,
    ) -> Result<(), ExrFault> {
        if self.samples[component].replace(samples).is_some() {
            return Err(ExrFault::Duplicate(light));
        }
        if self.size != size {
            return Err(ExrFault::SizeMismatch(light));
        }
        Ok(())
    }

    fn collect(self, light: String) -> Result<LightLayer, ExrFault> {
        let Vec2(width, height) = self.size;
        let mut pixels = vec![[0.0, 0.0, 0.0, 1.0]; width * height];
        for (component, samples) in self.samples.iter().enumerate() {
            let Some(samples) = samples else {
                if component == 3 {
                    continue;
                }
                let channel = CHANNELS[component];
                return Err(ExrFault::MissingChannel { light, channel });
            };
            for (pixel, value) in pixels.iter_mut().zip(samples.values_as_f32()) {
                pixel[component] = value;
            }
        }
        let image = LinearImage {
            width: width as u32,
            height: height as u32,
            pixels,
        };
        Ok((light, image))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::exr::meta::header::ImageAttributes;

    fn image(width: u32, height: u32, seed: u32) -> LinearImage {
        let value =
            |i: u32| (i.wrapping_mul(2_654_435_761).wrapping_add(seed) as f32).sqrt() * 1e-3;
        let pixels =
            (0..width * height).map(|i| [value(3 * i), value(3 * i + 1), value(3 * i + 2), 1.0]);
        LinearImage {
            width,
            height,
            pixels: pixels.collect(),
        }
    }

    fn layers(names: &[&str]) -> Vec<LightLayer> {
        let layer = |(light, seed): (&&str, u32)| ((*light).to_owned(), image(37, 21, seed));
        names.iter().zip(1..).map(layer).collect()
    }

    #[test]
    fn layers_come_back_exactly_and_sorted() {
        let written = layers(&["a", "b.001", "z", "\u{43b}\u{430}\u{43c}\u{43f}\u{430}"]);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lights.exr");
        let bytes = encode_light_layers(&written).unwrap();
        std::fs::write(&path, &bytes).unwrap();
        assert!(read_light_layers(&path).unwrap() == written);
        assert!(encode_light_layers(&written).unwrap() == bytes);

        let mut shuffled = written.clone();
        shuffled.reverse();
        let bytes = encode_light_layers(&shuffled).unwrap();
        assert!(decode_light_layers(&bytes).unwrap() == written);
    }

    #[test]
    fn a_plain_picture_has_the_channels_r_g_b() {
        let picture = image(5, 4, 9);
        let bytes = encode_rgb(&picture).unwrap();
        let read = decode(&bytes).unwrap();
        let channels = &read.layer_data[0].channel_data.list;
        let names: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
        assert_eq!(names, ["B", "G", "R"]);
        let red: Vec<f32> = channels[2].sample_data.values_as_f32().collect();
        let want: Vec<f32> = picture.pixels.iter().map(|p| p[0]).collect();
        assert_eq!(red, want);
        let error = decode_light_layers(&bytes).unwrap_err().to_string();
        assert!(error.starts_with("no layer is named"), "{error}");
        let error = read_light_layers(Path::new("no/such.exr")).unwrap_err();
        assert!(error.to_string().starts_with("no/such.exr: "), "{error}");
    }

    #[test]
    fn the_light_groups_of_a_renderer_sum_to_their_combined_layer() {
        let Some(file) = crate::builtin::published::data("exr/cornell_light_groups.exr") else {
            return;
        };
        let bytes = std::fs::read(file).unwrap();
        let lights = decode_light_layers(&bytes).unwrap();
        let names: Vec<&str> = lights.iter().map(|l| l.0.as_str()).collect();
        assert_eq!(names, ["ceiling", "point", "side", "spot"]);

        let file = decode(&bytes).unwrap();
        let layer = &file.layer_data[0];
        for (component, channel) in CHANNELS[..3].iter().enumerate() {
            let name = format!("ViewLayer.Combined.{channel}");
            let mut all = layer.channel_data.list.iter();
            let combined = all.find(|c| c.name.to_string() == name).unwrap();
            for (i, total) in combined.sample_data.values_as_f32().enumerate() {
                let parts = lights.iter().map(|l| l.1.pixels[i][component]);
                let sum: f32 = parts.clone().sum();
                let rounding = (parts.map(f32::abs).sum::<f32>() + total.abs()) / 2048.0 + 1e-6;
                assert!((sum - total).abs() <= rounding, "pixel {i}: {sum} {total}");
            }
        }
    }

    #[test]
    fn parts_of_their_own_are_layers_too() {
        let part = |name: &str, seed: u32| {
            Layer::new(
                (8_usize, 3_usize),
                LayerAttributes::named(Text::new_or_panic(name)),
                Encoding::SMALL_LOSSLESS,
                AnyChannels::sort(rgb(&image(8, 3, seed), "").to_vec().into()),
            )
        };
        let parts = vec![
            part("ViewLayer.Combined", 1),
            part("ViewLayer.Combined_b", 2),
            part("Combined_a", 3),
        ];
        let mut bytes = Cursor::new(Vec::new());
        let file = Image::from_layers(ImageAttributes::with_size((8, 3)), parts);
        file.write().non_parallel().to_buffered(&mut bytes).unwrap();
        let lights = decode_light_layers(bytes.get_ref()).unwrap();
        assert_eq!(lights.len(), 2);
        assert!(lights[0] == ("a".to_owned(), image(8, 3, 3)));
        assert!(lights[1] == ("b".to_owned(), image(8, 3, 2)));
    }

    #[test]
    fn what_cannot_be_written_is_refused() {
        let fault = |names: &[&str]| encode_light_layers(&layers(names)).unwrap_err();
        assert!(matches!(fault(&[]), ExrFault::NoLights));
        assert!(matches!(fault(&["a", "a"]), ExrFault::Duplicate(_)));
        for bad in ["", "a\0b", &"x".repeat(300)] {
            assert!(matches!(fault(&[bad]), ExrFault::Name(_)), "{bad}");
        }
        let mut uneven = layers(&["a", "b"]);
        uneven[1].1 = image(37, 20, 1);
        let error = encode_light_layers(&uneven).unwrap_err();
        assert!(matches!(error, ExrFault::SizeMismatch(_)));
        assert!(encode_rgb(&LinearImage::empty(0, 0)).is_err());
    }

    #[test]
    fn an_incomplete_layer_names_its_missing_channel() {
        let picture = image(4, 4, 1);
        let [r, _, b] = rgb(&picture, "V.Combined_key.");
        let bytes = encode(&picture, vec![r, b]).unwrap();
        let error = decode_light_layers(&bytes).unwrap_err().to_string();
        assert_eq!(
            error,
            "the layer of light `key` has no channel G; write red, green and blue"
        );
    }

    #[test]
    fn truncated_files_are_errors() {
        let bytes = encode_light_layers(&layers(&["key", "fill"])).unwrap();
        for length in (0..bytes.len()).step_by(bytes.len() / 400) {
            let error = decode_light_layers(&bytes[..length])
                .unwrap_err()
                .to_string();
            assert!(!error.contains('\n'), "{error}");
        }
    }

    #[test]
    fn damaged_files_never_panic() {
        let bytes = encode_light_layers(&layers(&["key", "fill"])).unwrap();
        let mut state = 1_u32;
        for _ in 0..2000 {
            let mut damaged = bytes.clone();
            for _ in 0..3 {
                state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
                let place = (state >> 8) as usize % if state & 64 == 0 { 600 } else { bytes.len() };
                damaged[place] ^= 1 << (state & 7);
            }
            if let Err(error) = decode_light_layers(&damaged) {
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }
}
