//! A rendered picture with a layer per light, as contributions of every light to every pixel.
//!
//! Light is linear whoever computed it: the layer of a light, at nominal emission, is what the light
//! contributes to the picture, and the picture under any mix is the weighted sum of the layers. Nominal emission is 1.
//!
//! Renderers leave negative pixels (filters with negative lobes) and NaN (a sample that failed); they become 0, and
//! are counted.

use relume::color::Rgb;

use super::exr::LightLayer;
use crate::solution::Solution;

/// Contributions whose elements are pixels, row by row from the top, and how many values were no light.
///
/// The layers have one size, as [`read_light_layers`](super::exr::read_light_layers) makes sure.
#[must_use]
pub fn contributions(layers: &[LightLayer]) -> (Solution, usize) {
    let size = layers.first().map(|(_, image)| [image.width, image.height]);
    let pixels = layers.first().map_or(0, |(_, image)| image.pixels.len());
    let mut repaired = 0;
    let mut light_of = |value: f32| {
        let is_light = value.is_finite() && value >= 0.0;
        repaired += usize::from(!is_light);
        if is_light { value } else { 0.0 }
    };
    let mut contributions = Vec::with_capacity(pixels * layers.len());
    for pixel in 0..pixels {
        for (_, image) in layers {
            let [r, g, b, _] = image.pixels[pixel];
            contributions.push(Rgb::from_array([r, g, b].map(&mut light_of)));
        }
    }
    let lights = layers.iter().map(|(name, _)| (name.clone(), Rgb::WHITE));
    let solution = Solution {
        image: size,
        ..Solution::from_contributions(lights, contributions)
    };
    (solution, repaired)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::LinearImage;

    #[test]
    fn what_is_no_light_becomes_none_and_is_counted() {
        let image = |pixels| LinearImage {
            width: 2,
            height: 1,
            pixels,
        };
        let layers = [
            (
                "a".to_owned(),
                image(vec![[1.0, -0.5, 0.0, 1.0], [2.0, 3.0, 4.0, 1.0]]),
            ),
            (
                "b".to_owned(),
                image(vec![[f32::NAN, 5.0, f32::INFINITY, 1.0]; 2]),
            ),
        ];
        let (solution, repaired) = contributions(&layers);
        assert_eq!(solution.image, Some([2, 1]));
        assert_eq!(repaired, 1 + 4);
        let five = Rgb::new(0.0, 5.0, 0.0);
        let expected = [Rgb::new(1.0, 0.0, 0.0), five, Rgb::new(2.0, 3.0, 4.0), five];
        assert_eq!(solution.contributions, expected);
    }
}
