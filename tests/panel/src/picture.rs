//! The flat under the lamps as they are: the atlas relit tile by tile, straight to the display.

use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{Point, Size};
use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::primitives::Rectangle;
use relume::atlas::{Atlas, Block, LARGEST_SIDE, Place};
use relume::relight::{FixedTable, Terms};

use crate::layout::PICTURE;
use crate::tone::Tone;

pub(crate) fn draw<D: DrawTarget<Color = Rgb565>>(
    display: &mut D,
    atlas: &Atlas,
    table: &FixedTable,
    tone: &Tone,
) -> Result<(), D::Error> {
    let Some(tiles) = atlas.tiles() else {
        return Ok(());
    };
    let mut codes: Block = [[0; 3]; LARGEST_SIDE * LARGEST_SIDE];
    for (place, mut bits) in tiles.iter() {
        let mut sums = [[0_u32; 3]; LARGEST_SIDE * LARGEST_SIDE];
        for (light, tag) in atlas.lights().zip(0..) {
            if bits.next_light(place, light.last, &mut codes) {
                for (sum, codes) in sums.iter_mut().zip(&codes) {
                    let [r, g, b] = table.terms(tag, *codes);
                    let [sum_r, sum_g, sum_b] = *sum;
                    *sum = [
                        sum_r.wrapping_add(r),
                        sum_g.wrapping_add(g),
                        sum_b.wrapping_add(b),
                    ];
                }
            }
        }
        let area = area(place);
        display.fill_contiguous(&area, sums.iter().map(|sum| tone.pixel(*sum)))?;
    }
    Ok(())
}

/// Where a tile stands on the screen.
fn area(place: Place) -> Rectangle {
    let width = PICTURE.size.width;
    let corner = Point::new((place.first % width) as i32, (place.first / width) as i32);
    let size = Size::new(place.columns.into(), place.rows.into());
    Rectangle::new(PICTURE.top_left + corner, size)
}
