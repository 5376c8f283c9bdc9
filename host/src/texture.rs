//! Textures of reflectance: an image in linear RGB and where a surface's corners lie in it.
//!
//! A texel is a square of one colour, the image repeats outside the unit square, and the mean over
//! a part of a surface weights every texel `k` with the area that the part covers of it:
//! `mean = sum_k a_k c_k / sum_k a_k`. That is the mean over the surface itself where the map from
//! surface to image is affine, as it is on triangles and on the quads that importers put together;
//! a file's own quads are taken as two triangles. A part without area in the image takes the texel
//! at its middle; one that covers very many texels takes the mean of 4096 of them, spread by the
//! R2 sequence (Roberts 2018).
//!
//! Files hold sRGB (IEC 61966-2-1); it is decoded before anything is averaged.

use std::io::Cursor;
use std::sync::{Arc, LazyLock};

use glam::{Vec2, Vec3};
use image::error::{LimitError, LimitErrorKind};
use image::{DynamicImage, ImageDecoder, ImageError};
use relume::color::Rgb;
use relume::geometry::clip;

/// Largest reflectance that an importer lets pass, per channel: above it light would bounce
/// almost for ever.
pub const MAX_REFLECTANCE: f32 = 0.98;

/// Triangles whose bounding box holds more texels than this are sampled.
const MOST_TEXELS: f32 = 65_536.0;

/// How many texels such a sample has.
const SAMPLES: u32 = 4096;

/// What a decoder may allocate for one image, in bytes.
const MOST_BYTES: u64 = 1 << 29;

/// Largest number of texels of an image: 8192 x 8192, which are 0.8 GB as they are kept.
pub const LARGEST_IMAGE: u64 = 1 << 26;

/// An image in linear RGB.
#[derive(Debug)]
pub struct Image {
    /// Width in texels, above zero.
    pub width: usize,
    /// Height in texels, above zero.
    pub height: usize,
    /// Linear RGB, row by row from the top (`v = 0`), `width * height` texels.
    pub texels: Vec<[f32; 3]>,
}

impl Image {
    /// Decodes the bytes of a PNG or JPEG file.
    ///
    /// # Errors
    /// What the decoder says: damaged, of another format, or too large.
    pub fn decode(bytes: &[u8]) -> Result<Self, ImageError> {
        let mut reader = image::ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
        let mut limits = image::Limits::default();
        limits.max_alloc = Some(MOST_BYTES);
        reader.limits(limits);
        let decoder = reader.into_decoder()?;
        let (width, height) = decoder.dimensions();
        if u64::from(width) * u64::from(height) > LARGEST_IMAGE {
            let too_large = LimitErrorKind::DimensionError;
            return Err(ImageError::Limits(LimitError::from_kind(too_large)));
        }
        let encoded = DynamicImage::from_decoder(decoder)?.into_rgb16();

        let decode = |code: u16| LINEAR.get(usize::from(code)).copied().unwrap_or_default();
        Ok(Self {
            width: encoded.width() as usize,
            height: encoded.height() as usize,
            texels: encoded.pixels().map(|texel| texel.0.map(decode)).collect(),
        })
    }

    /// Mean of all texels.
    #[must_use]
    pub fn mean(&self) -> Rgb {
        let mut sum = WeightedSum::default();
        for texel in &self.texels {
            sum.add(*texel, 1.0);
        }
        sum.mean().unwrap_or_default()
    }

    /// The texel at a place given in texels, repeated in both directions.
    fn texel(&self, place: Vec2) -> [f32; 3] {
        let wrap = |x: f32, size: usize| (x.floor().rem_euclid(size as f32) as usize).min(size - 1);
        if self.width == 0 || self.height == 0 {
            return [0.0; 3];
        }
        let (column, row) = (wrap(place.x, self.width), wrap(place.y, self.height));
        let texel = self.texels.get(row * self.width + column);
        texel.copied().unwrap_or_default()
    }
}

/// The linear light of every code.
static LINEAR: LazyLock<Vec<f32>> =
    LazyLock::new(|| (0..=u16::MAX).map(linear_from_srgb).collect());

/// The sRGB transfer function, from code to linear light.
fn linear_from_srgb(code: u16) -> f32 {
    let encoded = f64::from(code) / f64::from(u16::MAX);
    let linear = if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    };
    linear as f32
}

/// The reflectance, with every channel brought into [0, [`MAX_REFLECTANCE`]].
#[must_use]
pub fn clamp_reflectance(reflectance: Rgb) -> Rgb {
    reflectance.map(|channel| channel.clamp(0.0, MAX_REFLECTANCE))
}

/// The texture of one surface.
#[derive(Clone, Debug)]
pub struct SurfaceTexture {
    /// The image, repeated outside the unit square.
    pub image: Arc<Image>,
    /// Factor on every texel.
    pub factor: [f32; 3],
    /// Texture coordinates of the surface's vertices, in their order (three or four).
    pub corners: Vec<Vec2>,
}

impl SurfaceTexture {
    /// Mean reflectance over a part of the surface, in [0, [`MAX_REFLECTANCE`]].
    ///
    /// `from` and `to` are the parameter corners of an element, as [`relume::mesh::Element`] has
    /// them and [`relume::geometry::Polygon::part`] takes them; `(0, 0)` and `(1, 1)` give the
    /// whole surface.
    #[must_use]
    pub fn mean_over(&self, from: Vec2, to: Vec2) -> Rgb {
        clamp_reflectance(self.unclamped_mean_over(from, to))
    }

    /// The same before it is clamped.
    pub(crate) fn unclamped_mean_over(&self, from: Vec2, to: Vec2) -> Rgb {
        let a = self.place(from);
        let b = self.place(Vec2::new(to.x, from.y));
        let d = self.place(Vec2::new(from.x, to.y));
        let mut sum = WeightedSum::default();
        let middle = if self.corners.len() == 3 {
            self.add_triangle([a, b, d], &mut sum);
            (a + b + d) / 3.0
        } else {
            let c = self.place(to);
            self.add_triangle([a, b, c], &mut sum);
            self.add_triangle([a, c, d], &mut sum);
            (a + b + c + d) * 0.25
        };
        let mean = sum.mean();
        mean.unwrap_or_else(|| Rgb::from_array(self.image.texel(middle)))
            * Rgb::from_array(self.factor)
    }

    /// The texture of the same surface seen from behind, as [`relume::geometry::Polygon::flipped`]
    /// orders its vertices.
    #[must_use]
    pub fn flipped(&self) -> Self {
        let mut corners = self.corners.clone();
        if let Some((_, rest)) = corners.split_first_mut() {
            rest.reverse();
        }
        Self {
            image: Arc::clone(&self.image),
            factor: self.factor,
            corners,
        }
    }

    /// Texture coordinates of the point of the surface with these parameters.
    #[must_use]
    pub fn coordinates(&self, at: Vec2) -> Vec2 {
        match *self.corners {
            [a, b, c] => a + (b - a) * at.x + (c - a) * at.y,
            [a, b, c, d] => {
                a + (b - a) * at.x + (d - a) * at.y + ((c - d) - (b - a)) * (at.x * at.y)
            }
            _ => Vec2::ZERO,
        }
    }

    /// Where that lies in the image, in texels.
    fn place(&self, at: Vec2) -> Vec2 {
        self.coordinates(at) * Vec2::new(self.image.width as f32, self.image.height as f32)
    }

    /// Adds the texels that a triangle covers.
    fn add_triangle(&self, corners: [Vec2; 3], sum: &mut WeightedSum) {
        // Counted from the triangle's own first texel, areas keep their digits far from the origin.
        let [a, b, c] = corners;
        let first = a.min(b).min(c).floor();
        let size = (a.max(b).max(c) - first).ceil();
        let texels = size.max(Vec2::ONE);
        if texels.x * texels.y > MOST_TEXELS {
            self.add_samples(corners, sum);
            return;
        }
        let triangle = corners.map(|corner| (corner - first).extend(0.0));
        for row in 0..size.y as u32 {
            let top = row as f32;
            let below = clip(&triangle, |v| v.y - top);
            let band = clip(&below, |v| top + 1.0 - v.y);
            let low = band.iter().map(|v| v.x).fold(f32::INFINITY, f32::min);
            let high = band.iter().map(|v| v.x).fold(0.0, f32::max);
            for column in low as u32..high.ceil() as u32 {
                let left = column as f32;
                let right_of = clip(&band, |v| v.x - left);
                let covered = clip(&right_of, |v| left + 1.0 - v.x);
                let texel = self.image.texel(first + Vec2::new(left, top));
                sum.add(texel, area(&covered));
            }
        }
    }

    /// Adds evenly spread texels of a triangle, which together weigh as much as its area.
    fn add_samples(&self, [a, b, c]: [Vec2; 3], sum: &mut WeightedSum) {
        /// Inverse of the plastic number, and its square.
        const STEP: Vec2 = Vec2::new(0.754_877_7, 0.569_840_3);
        let weight = (b - a).perp_dot(c - a).abs() * 0.5 / SAMPLES as f32;
        for i in 0..SAMPLES {
            let in_square = (STEP * (i as f32 + 0.5)).fract();
            let folded = if in_square.x + in_square.y > 1.0 {
                Vec2::ONE - in_square
            } else {
                in_square
            };
            let place = a + (b - a) * folded.x + (c - a) * folded.y;
            sum.add(self.image.texel(place), weight);
        }
    }
}

/// Area of a convex outline in the plane `z = 0`, whichever way it turns.
fn area(outline: &[Vec3]) -> f32 {
    let Some((origin, rest)) = outline.split_first() else {
        return 0.0;
    };
    let fan = rest.iter().zip(rest.iter().skip(1));
    let twice: f32 = fan.map(|(b, c)| (*b - *origin).cross(*c - *origin).z).sum();
    twice.abs() * 0.5
}

/// Texels and their weights, summed.
#[derive(Default)]
struct WeightedSum {
    sum: [f64; 3],
    weight: f64,
}

impl WeightedSum {
    fn add(&mut self, texel: [f32; 3], weight: f32) {
        let weight = f64::from(weight);
        for (sum, channel) in self.sum.iter_mut().zip(texel) {
            *sum += f64::from(channel) * weight;
        }
        self.weight += weight;
    }

    /// `None` without weight, or with more than numbers can say.
    fn mean(&self) -> Option<Rgb> {
        let mean = self.sum.map(|sum| (sum / self.weight) as f32);
        (self.weight > 0.0 && self.weight.is_finite()).then_some(Rgb::from_array(mean))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use relume::geometry::Polygon;

    const WHOLE: (Vec2, Vec2) = (Vec2::ZERO, Vec2::ONE);

    fn texture(width: usize, red: &[f32], corners: &[[f32; 2]]) -> SurfaceTexture {
        SurfaceTexture {
            image: Arc::new(Image {
                width,
                height: red.len() / width,
                texels: red.iter().map(|r| [*r, 0.5, 0.0]).collect(),
            }),
            factor: [1.0; 3],
            corners: corners.iter().copied().map(Vec2::from).collect(),
        }
    }

    const SQUARE: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

    /// The beginning of a grey PNG of this height, 8192 wide, with the CRC-32 of its header.
    fn start_of_png(height: u32, crc: u32) -> Vec<u8> {
        let header = [
            &8192_u32.to_be_bytes()[..],
            &height.to_be_bytes(),
            &[8, 0, 0, 0, 0],
        ];
        [
            b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec(),
            header.concat(),
            crc.to_be_bytes().to_vec(),
            b"\0\0\x01\0IDAT".to_vec(),
        ]
        .concat()
    }

    #[test]
    fn an_image_above_the_limit_is_refused_by_its_header() {
        let error = |height, crc| Image::decode(&start_of_png(height, crc)).unwrap_err();
        assert!(matches!(error(8193, 0x9c9d_4620), ImageError::Limits(_)));
        // One row less is legal, and then the texels are missing.
        assert!(!matches!(error(8192, 0x57c1_9585), ImageError::Limits(_)));
    }

    #[test]
    fn a_quad_averages_exactly_the_texels_that_it_covers() {
        let quad = texture(2, &[0.1, 0.3, 0.5, 0.9], &SQUARE);
        let mean = |from, to| quad.mean_over(from, to).r;
        assert!((mean(WHOLE.0, WHOLE.1) - 0.45).abs() < 1e-6);
        assert!((mean(Vec2::ZERO, Vec2::splat(0.5)) - 0.1).abs() < 1e-6);
        assert!((mean(Vec2::new(0.5, 0.0), Vec2::new(1.0, 0.5)) - 0.3).abs() < 1e-6);
        // Three quarters of the first column, one quarter of the second.
        assert!((mean(Vec2::new(0.125, 0.0), Vec2::new(0.625, 0.5)) - 0.15).abs() < 1e-6);
        assert_eq!(quad.mean_over(WHOLE.0, WHOLE.1).g, 0.5);
    }

    #[test]
    fn a_triangle_weights_texels_by_covered_area() {
        // The lower left half of 2 x 2 texels: one texel whole, two halves, one not at all.
        let half = texture(2, &[0.8, 0.4, 0.2, 0.9], &SQUARE[..3]);
        let mirrored = texture(
            2,
            &[0.8, 0.4, 0.2, 0.9],
            &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        );
        let expected = (0.8 + 0.5 * 0.4 + 0.5 * 0.2) / 2.0;
        assert!((mirrored.mean_over(WHOLE.0, WHOLE.1).r - expected).abs() < 1e-6);
        let expected = (0.4 + 0.5 * 0.8 + 0.5 * 0.9) / 2.0;
        assert!((half.mean_over(WHOLE.0, WHOLE.1).r - expected).abs() < 1e-6);
        // Its small triangle that points the other way lies astride the diagonal.
        let down = mirrored.mean_over(Vec2::splat(0.5), Vec2::ZERO).r;
        assert!((down - 0.8).abs() < 1e-6, "{down}");
    }

    #[test]
    fn images_repeat_and_far_away_is_like_near() {
        let red = [0.1, 0.3, 0.5, 0.9];
        let near = texture(2, &red, &SQUARE).mean_over(Vec2::splat(0.1), Vec2::splat(0.7));
        for shift in [-3.0, -1.0, 2.0, 100.0] {
            let moved = SQUARE.map(|[u, v]| [u + shift, v - shift]);
            let far = texture(2, &red, &moved).mean_over(Vec2::splat(0.1), Vec2::splat(0.7));
            assert!((far.r - near.r).abs() < 1e-4, "{shift}: {far:?} {near:?}");
        }
        // So many repeats that they are sampled.
        let many = SQUARE.map(|corner| corner.map(|x| x * 1000.0));
        let mean = texture(2, &red, &many).mean_over(WHOLE.0, WHOLE.1).r;
        assert!((mean - 0.45).abs() < 2e-3, "{mean}");
    }

    #[test]
    fn no_area_takes_the_texel_and_nonsense_does_not_panic() {
        let red = [0.1, 0.3, 0.5, 0.9];
        let point = texture(2, &red, &[[0.75, 0.25]; 4]);
        assert!((point.mean_over(WHOLE.0, WHOLE.1).r - 0.3).abs() < 1e-6);
        for bad in [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e30] {
            for corners in [
                [[0.0, 0.0], [bad, 0.0], [0.0, bad]],
                [[0.0, 0.0], [0.0, bad], [0.0, 1.0]],
            ] {
                let mean = texture(2, &red, &corners).mean_over(WHOLE.0, WHOLE.1);
                assert!((0.0..=MAX_REFLECTANCE).contains(&mean.r), "{bad}: {mean:?}");
            }
        }
    }

    #[test]
    fn factors_apply_and_the_mean_is_clamped() {
        let mut bright = texture(1, &[0.9], &SQUARE);
        bright.factor = [2.0, 0.5, 1.0];
        let mean = bright.mean_over(WHOLE.0, WHOLE.1);
        assert_eq!(mean.to_array(), [MAX_REFLECTANCE, 0.25, 0.0]);
        assert!((bright.unclamped_mean_over(WHOLE.0, WHOLE.1).r - 1.8).abs() < 1e-6);
    }

    #[test]
    fn flipping_follows_the_polygon() {
        let corners: [[f32; 2]; 4] = [[0.0, 0.0], [2.0, 0.1], [1.9, 1.2], [0.2, 1.0]];
        for corners in [&corners[..], &corners[..3]] {
            let vertices: Vec<Vec3> = corners.iter().map(|c| Vec2::from(*c).extend(0.0)).collect();
            let back = Polygon::new(&vertices).unwrap().flipped();
            let texture = texture(1, &[0.5], corners).flipped();
            let expected: Vec<Vec2> = back.vertices().iter().map(|v| v.truncate()).collect();
            assert_eq!(texture.corners, expected);
        }
    }

    #[test]
    fn png_is_decoded_to_linear_light() {
        let mut png = Cursor::new(Vec::new());
        let mut picture = image::RgbImage::new(2, 1);
        picture.put_pixel(0, 0, image::Rgb([188, 0, 255]));
        picture.put_pixel(1, 0, image::Rgb([10, 255, 128]));
        picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let decoded = Image::decode(png.get_ref()).unwrap();
        assert_eq!((decoded.width, decoded.height), (2, 1));
        // Values of the sRGB formula, worked out by hand.
        let expected = [[0.502_886_5, 0.0, 1.0], [0.003_035_3, 1.0, 0.215_860_5]];
        for (texel, expected) in decoded.texels.iter().zip(expected) {
            for (a, b) in texel.iter().zip(expected) {
                assert!((a - b).abs() < 1e-6, "{texel:?} {expected:?}");
            }
        }
        assert!((decoded.mean().g - 0.5).abs() < 1e-6);

        let bytes = png.get_ref();
        for end in 0..bytes.len() {
            let _ = Image::decode(&bytes[..end]);
        }
        assert!(Image::decode(b"GIF89a").is_err());
    }
}
