//! A contact sheet: several pictures in a grid, each with its caption.

use tiny_skia::{Paint, PathBuilder, Pixmap, Rect, Stroke, Transform};

use super::label::{Letters, write_label};
use super::{PictureError, filled, lay};

/// Pixels around everything.
const MARGIN: u32 = 12;
/// Paper, ink and frame colours.
pub(super) const PAPER: [u8; 3] = [250, 250, 248];
pub(super) const INK: [u8; 3] = [32, 32, 36];
pub(super) const FRAME: [u8; 3] = [140, 140, 146];

/// One picture of a sheet.
#[derive(Clone, Debug)]
pub struct Tile {
    /// The picture.
    pub picture: Pixmap,
    /// One line below it.
    pub caption: String,
}

/// Size of a cell and of the sheet, in pixels.
struct Layout {
    columns: u32,
    cell: (u32, u32),
    top: u32,
    size: (u32, u32),
}

impl Layout {
    /// Cells as large as the largest picture and the longest caption.
    fn new(tiles: &[Tile], columns: u32, title: &str) -> Self {
        let count = u32::try_from(tiles.len()).unwrap_or(u32::MAX);
        let columns = columns.clamp(1, count.max(1));
        let largest = |side: fn(&Tile) -> u32| tiles.iter().map(side).max().unwrap_or(0);
        let width = largest(|t| t.picture.width().max(Letters::Small.width(&t.caption)));
        let height = largest(|t| t.picture.height());
        let cell = (
            width + MARGIN,
            height + Letters::Small.height() + MARGIN + 4,
        );

        let top = if title.is_empty() {
            MARGIN
        } else {
            2 * MARGIN + Letters::Large.height()
        };
        let wide = (columns * cell.0).max(Letters::Large.width(title) + MARGIN);
        Self {
            columns,
            cell,
            top,
            size: (MARGIN + wide, top + count.div_ceil(columns) * cell.1),
        }
    }

    /// Top left corner of a cell.
    fn place(&self, index: u32) -> (u32, u32) {
        let (column, row) = (index % self.columns, index / self.columns);
        (MARGIN + column * self.cell.0, self.top + row * self.cell.1)
    }
}

/// Puts pictures on one sheet, row by row, `columns` in a row; an empty title takes no room.
///
/// # Errors
/// [`PictureError::Size`] when the sheet would be too large.
pub fn sheet(tiles: &[Tile], columns: u32, title: &str) -> Result<Pixmap, PictureError> {
    let layout = Layout::new(tiles, columns, title);
    let mut paper = filled(layout.size.0, layout.size.1, PAPER)?;
    let corner = (MARGIN as i32, MARGIN as i32);
    write_label(&mut paper, corner, title, Letters::Large, INK);

    for (tile, index) in tiles.iter().zip(0..) {
        let (x, y) = layout.place(index);
        let (width, height) = (tile.picture.width(), tile.picture.height());
        let middle = (layout.cell.0 - MARGIN - width) / 2;
        lay(&mut paper, &tile.picture, (x + middle) as i32, y as i32);
        frame(&mut paper, [x + middle, y, width, height]);

        let caption_width = Letters::Small.width(&tile.caption);
        let indent = (layout.cell.0 - MARGIN - caption_width) / 2;
        let below = ((x + indent) as i32, (y + height + 4) as i32);
        write_label(&mut paper, below, &tile.caption, Letters::Small, INK);
    }
    Ok(paper)
}

/// Draws a line of one pixel just outside the rectangle `[x, y, width, height]`.
pub(super) fn frame(picture: &mut Pixmap, rectangle: [u32; 4]) {
    let [x, y, width, height] = rectangle.map(|v| v as f32);
    let outline = Rect::from_xywh(x - 0.5, y - 0.5, width + 1.0, height + 1.0);
    if let Some(outline) = outline {
        let path = PathBuilder::from_rect(outline);
        let stroke = Stroke::default();
        picture.stroke_path(&path, &ink(FRAME), &stroke, Transform::identity(), None);
    }
}

/// Paint of one colour.
pub(super) fn ink([r, g, b]: [u8; 3]) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, 255);
    paint
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(width: u32, height: u32, caption: &str) -> Tile {
        Tile {
            picture: filled(width, height, [255, 0, 0]).unwrap(),
            caption: caption.to_owned(),
        }
    }

    #[test]
    fn every_picture_is_on_the_sheet_once_and_whole() {
        let tiles = [
            tile(40, 30, "one"),
            tile(30, 40, "a long caption"),
            tile(9, 9, ""),
        ];
        for columns in [0, 1, 2, 3, 9] {
            let paper = sheet(&tiles, columns, "Title").unwrap();
            let red = paper
                .pixels()
                .iter()
                .filter(|p| (p.red(), p.green(), p.blue()) == (255, 0, 0));
            assert_eq!(red.count(), 40 * 30 + 30 * 40 + 9 * 9, "{columns} columns");
        }
    }

    #[test]
    fn a_sheet_of_nothing_is_empty_paper() {
        let paper = sheet(&[], 3, "").unwrap();
        let first = paper.pixels()[0];
        assert!(paper.pixels().iter().all(|p| *p == first));
    }
}
