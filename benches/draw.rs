//! Drawing on a device's display: frames per second of the Cornell box.
//!
//! 320 x 240 pixels in RGB565 with a depth buffer for the whole display or for 16 rows of it,
//! and what comes before it: the colours of all elements, from irradiance to RGB565. One thread.

mod scenes;

use std::convert::Infallible;
use std::hint::black_box;

use criterion::{Criterion, Throughput};
use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Size};
use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::pixelcolor::raw::RawU16;
use embedded_graphics::primitives::Rectangle;
use relume::atlas::{Atlas, AtlasMesh};
use relume::code::Code;
use relume::color::Rgb;
use relume::draw::{Camera, Sample, Shown, paint};
use relume::tone::{Exposure, radiance};
use relume_host::pack::pack;

const WIDTH: u32 = 320;
const HEIGHT: u32 = 240;

fn main() {
    let mut criterion = scenes::criterion();
    let builtin = scenes::cornell();
    let solution = scenes::baked(&builtin.scene, &scenes::settings(&builtin, 0.1));
    let bytes = pack(&solution, scenes::format(Code::Exp8s)).expect("values in range");
    let atlas = Atlas::parse(&bytes).expect("bytes just written");
    let mesh = atlas.mesh().expect("it was packed with its mesh");

    let irradiance = solution.relight(&solution.nominal_mix());
    let colors = colors(&mesh, &irradiance);
    tone(&mut criterion, &mesh, &irradiance);
    frames(&mut criterion, &mesh, &builtin.camera, &colors);
    criterion.final_summary();
}

fn tone(criterion: &mut Criterion, mesh: &AtlasMesh, irradiance: &[Rgb]) {
    let mut group = criterion.benchmark_group("draw");
    group.throughput(Throughput::Elements(irradiance.len() as u64));
    group.bench_function("colours of all elements", |bencher| {
        bencher.iter(|| colors(mesh, black_box(irradiance)));
    });
    group.finish();
}

fn colors(mesh: &AtlasMesh, irradiance: &[Rgb]) -> Vec<Rgb565> {
    let exposure = Exposure::for_white(1.0);
    let colors = irradiance.iter().zip(0..).map(|(irradiance, number)| {
        let element = mesh.element(number).expect("one per element");
        let radiance = radiance(element.reflectance, *irradiance, Rgb::BLACK);
        RawU16::new(exposure.rgb565(radiance)).into()
    });
    colors.collect()
}

fn frames(criterion: &mut Criterion, mesh: &AtlasMesh, camera: &Camera, colors: &[Rgb565]) {
    let black = Rgb565::new(0, 0, 0);
    let color = |shown| match shown {
        Shown::Element(number) => colors[number as usize],
        Shown::Lamp(_) => Rgb565::new(31, 63, 31),
        Shown::Unlit => black,
    };
    let mut display = Display(vec![black; (WIDTH * HEIGHT) as usize]);
    let mut group = criterion.benchmark_group("draw/frame");
    group.throughput(Throughput::Elements(1));
    for rows in [HEIGHT, 16] {
        let mut band = vec![Sample::new(black); (WIDTH * rows) as usize];
        group.bench_function(format!("{rows} rows at a time"), |bencher| {
            bencher.iter(|| {
                let painted = paint(&mut display, mesh, camera, black, &mut band, color);
                painted.expect("a legal camera");
                black_box(&display.0);
            });
        });
    }
    group.finish();
}

/// A display that is memory.
struct Display(Vec<Rgb565>);

impl OriginDimensions for Display {
    fn size(&self) -> Size {
        Size::new(WIDTH, HEIGHT)
    }
}

impl DrawTarget for Display {
    type Color = Rgb565;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb565>>>(
        &mut self,
        pixels: I,
    ) -> Result<(), Infallible> {
        for Pixel(at, color) in pixels {
            self.0[(at.y as u32 * WIDTH + at.x as u32) as usize] = color;
        }
        Ok(())
    }

    fn fill_contiguous<I: IntoIterator<Item = Rgb565>>(
        &mut self,
        area: &Rectangle,
        colors: I,
    ) -> Result<(), Infallible> {
        // The painter's bands are as wide as the display.
        let start = area.top_left.y as u32 * WIDTH;
        let length = area.size.width * area.size.height;
        let pixels = &mut self.0[start as usize..(start + length) as usize];
        for (pixel, color) in pixels.iter_mut().zip(colors) {
            *pixel = color;
        }
        Ok(())
    }
}
