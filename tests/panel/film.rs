//! Pictures of a screen one after the other, as one animated PNG: each holds only the rectangle that has changed.

use anyhow::{Context, Result};
use embedded_graphics::geometry::Size;
use png::{BitDepth, BlendOp, ColorType, Compression, Encoder, Filter};

/// A pixel in sRGB.
type Pixel = [u8; 3];

/// Columns and rows, from and to.
type Part = [[usize; 2]; 2];

/// Frames with the hundredths of a second that each is seen.
pub struct Film {
    width: usize,
    height: usize,
    frames: Vec<(Vec<Pixel>, u16)>,
}

impl Film {
    pub fn new(size: Size) -> Self {
        Self {
            width: size.width as usize,
            height: size.height as usize,
            frames: Vec::new(),
        }
    }

    pub fn add(&mut self, pixels: Vec<Pixel>, time: u16) {
        self.frames.push((pixels, time));
    }

    /// Shows the last frame so long instead.
    pub fn rest(&mut self, time: u16) {
        if let Some((_, last)) = self.frames.last_mut() {
            *last = time;
        }
    }

    /// The bytes of the file; it runs for ever.
    pub fn png(&self) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut encoder = Encoder::new(&mut bytes, self.width as u32, self.height as u32);
        encoder.set_color(ColorType::Rgb);
        encoder.set_depth(BitDepth::Eight);
        encoder.set_compression(Compression::High);
        encoder.set_filter(Filter::Adaptive);
        if self.frames.len() > 1 {
            encoder.set_animated(self.frames.len() as u32, 0)?;
            encoder.set_blend_op(BlendOp::Source)?;
        }
        let mut writer = encoder.write_header()?;
        let mut before: Option<&[Pixel]> = None;
        for (pixels, time) in &self.frames {
            let whole = [[0, self.width], [0, self.height]];
            let part = before.map_or(whole, |before| self.changed(before, pixels));
            if self.frames.len() > 1 {
                let [[left, right], [top, bottom]] = part.map(|range| range.map(|at| at as u32));
                // Each is checked against the other's last value.
                writer.reset_frame_position()?;
                writer.set_frame_dimension(right - left, bottom - top)?;
                writer.set_frame_position(left, top)?;
                writer.set_frame_delay(*time, 100)?;
            }
            writer.write_image_data(&self.cut(pixels, part))?;
            before = Some(pixels);
        }
        writer.finish().context("the film")?;
        Ok(bytes)
    }

    /// The smallest part that holds all differences, at least a pixel.
    fn changed(&self, before: &[Pixel], after: &[Pixel]) -> Part {
        let differ = |(at, (a, b)): (usize, (&Pixel, &Pixel))| {
            (a != b).then_some([at % self.width, at / self.width])
        };
        let places: Vec<_> = before
            .iter()
            .zip(after)
            .enumerate()
            .filter_map(differ)
            .collect();
        [0, 1].map(|axis| {
            let along = places.iter().map(|place| place[axis]);
            let first = along.clone().min().unwrap_or(0);
            [first, along.max().unwrap_or(0) + 1]
        })
    }

    fn cut(&self, pixels: &[Pixel], [[left, right], [top, bottom]]: Part) -> Vec<u8> {
        let rows = pixels.chunks(self.width).take(bottom).skip(top);
        rows.flat_map(|row| row[left..right].as_flattened())
            .copied()
            .collect()
    }
}
