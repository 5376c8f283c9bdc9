//! One wall by one light alone, under every format side by side.
//!
//! The light is the one whose brightest spot is furthest above its own white; the wall is that one of the larger faces
//! on which the published code with a scale per light is furthest off on average. Irradiance is shown as it is packed: every element in one colour,
//! exposed for the white of the whole exact state.

use anyhow::{Context, Result};
use relume::color::Rgb;
use tiny_skia::Pixmap;

use super::errors::exposure;
use crate::display_error::shown_code;
use crate::picture::{LinearImage, Tile, sheet, to_pixmap, white};
use crate::solution::Solution;

/// Longest side of a wall, px.
const SIDE: f32 = 240.0;

/// Pictures in a row.
const COLUMNS: u32 = 4;

/// A light alone on a face.
#[derive(Clone, Copy, Debug)]
pub struct Wall<'a> {
    solution: &'a Solution,
    light: usize,
    face: usize,
    exposure: f32,
}

impl<'a> Wall<'a> {
    /// Looks for the light and the wall; `decoded` is what the published code makes of the solution.
    #[must_use]
    pub fn find(solution: &'a Solution, decoded: &[Rgb]) -> Option<Self> {
        let headroom = |light: &usize| {
            let own = column(solution, &solution.contributions, *light);
            let largest = own
                .iter()
                .map(|value| value.luminance())
                .fold(0.0, f32::max);
            largest / white(own).max(f32::MIN_POSITIVE)
        };
        let lights = 0..solution.lights.len();
        let light = lights.max_by(|a, b| headroom(a).total_cmp(&headroom(b)))?;
        let exact = column(solution, &solution.contributions, light);
        let found = column(solution, decoded, light);
        let exposure = exposure(&exact);
        let wall = |face| Self {
            solution,
            light,
            face,
            exposure,
        };
        let faces = solution.mesh.faces.iter().enumerate();
        let largest = faces.clone().map(|(_, face)| face.element_count).max()?;
        let walls = faces.filter(|(_, face)| face.element_count > largest / 2);
        let walls = walls.map(|(number, _)| wall(number));
        let off = |wall: &Self| wall.errors(&exact, &found).1;
        walls.max_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// What it shows.
    #[must_use]
    pub fn title(&self) -> String {
        let light = &self.solution.lights[self.light].name;
        format!(
            "{light} alone, exposed for its white; largest and mean error on this wall, display codes"
        )
    }

    /// Largest and mean error on the wall.
    fn errors(&self, exact: &[Rgb], found: &[Rgb]) -> (f32, f32) {
        let own = self.range();
        let code = |x: f32| shown_code(x * self.exposure);
        let channels = exact[own.clone()].iter().zip(&found[own]);
        let off = channels.flat_map(|(exact, found)| {
            let channels = exact.to_array().into_iter().zip(found.to_array());
            channels.map(|(exact, found)| (code(exact) - code(found)).abs())
        });
        let (mut largest, mut sum, mut count) = (0.0_f32, 0.0, 0.0);
        for off in off {
            largest = largest.max(off);
            sum += off;
            count += 1.0;
        }
        (largest, sum / count)
    }

    fn range(&self) -> std::ops::Range<usize> {
        let range = self.solution.mesh.faces[self.face].element_range();
        range.start as usize..range.end as usize
    }

    /// The wall as it is and under every format, by name.
    ///
    /// # Errors
    /// A picture that is too large.
    pub fn sheet(&self, formats: &[(&str, &[Rgb])]) -> Result<Pixmap> {
        let exact = column(self.solution, &self.solution.contributions, self.light);
        let mut tiles = vec![Tile {
            picture: self.picture(&exact)?,
            caption: "exact (f32)".to_owned(),
        }];
        for (name, decoded) in formats {
            let found = column(self.solution, decoded, self.light);
            let (largest, mean) = self.errors(&exact, &found);
            tiles.push(Tile {
                picture: self.picture(&found)?,
                caption: format!("{name}: {largest:.1}, {mean:.2}"),
            });
        }
        Ok(sheet(&tiles, COLUMNS, &self.title())?)
    }

    /// One picture: the elements of the face as they lie in it.
    fn picture(&self, irradiance: &[Rgb]) -> Result<Pixmap> {
        let mesh = &self.solution.mesh;
        let face = &mesh.faces[self.face];
        let [a, b, .., d] = face.polygon.vertices() else {
            anyhow::bail!("a face has three vertices");
        };
        let edges = [a.distance(*b), a.distance(*d)];
        let pixel = SIDE / edges[0].max(edges[1]);
        let [width, height] = edges.map(|edge| (edge * pixel).round().max(1.0) as u32);
        let mut image = LinearImage::empty(width, height);
        for (element, value) in mesh.elements[self.range()]
            .iter()
            .zip(&irradiance[self.range()])
        {
            let place = |at: f32, pixels: u32| (at * pixels as f32).round() as u32;
            let columns = place(element.from.x, width)..place(element.to.x, width);
            for y in place(element.from.y, height)..place(element.to.y, height) {
                for x in columns.clone() {
                    let at = (y * width + x) as usize;
                    let pixel = image
                        .pixels
                        .get_mut(at)
                        .context("elements lie in their face")?;
                    *pixel = [value.r, value.g, value.b, 1.0];
                }
            }
        }
        Ok(to_pixmap(&image, self.exposure, [0; 3])?)
    }
}

/// What a light contributes, at unit emission.
fn column(solution: &Solution, values: &[Rgb], light: usize) -> Vec<Rgb> {
    let own = values.iter().skip(light).step_by(solution.lights.len());
    own.copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::{Settings, bake};
    use crate::builtin::{PaperLamps, paper_room};

    #[test]
    fn a_wall_is_shown_once_for_every_format_and_exactly_where_nothing_is_lost() {
        let room = paper_room(PaperLamps::Eight).unwrap();
        let settings = Settings {
            patch: Some(1.0),
            element: Some(0.25),
            ..Settings::default()
        };
        let mut go_on = |_| std::ops::ControlFlow::Continue(());
        let solution = bake(&room.scene, &settings, &mut go_on).unwrap();
        let darker: Vec<Rgb> = solution.contributions.iter().map(|v| *v * 0.5).collect();
        let wall = Wall::find(&solution, &darker).unwrap();
        let exact = column(&solution, &solution.contributions, wall.light);
        assert_eq!(wall.errors(&exact, &exact), (0.0, 0.0));
        let same = wall.picture(&exact).unwrap();
        // No pixel of the wall is without an element.
        assert!(same.pixels().iter().all(|pixel| pixel.green() > 0));
        let whole = wall
            .sheet(&[("same", &solution.contributions), ("darker", &darker)])
            .unwrap();
        assert!(whole.width() > 3 * same.width());
    }
}
