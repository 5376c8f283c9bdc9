//! Who sees whom: a trait, and the brute-force answer over all surfaces.
//!
//! Assumption: every surface blocks light from both sides; end points lie on surfaces or in free
//! space. A surface that contains an end point (to within rounding) does not hide it.

use glam::Vec3;

use crate::scene::Surface;

/// Tells whether two points see each other.
pub trait Visibility {
    /// True when no surface crosses the open segment between the two points.
    fn sees(&self, from: Vec3, to: Vec3) -> bool;
}

/// Every surface of a scene, asked one after the other: work grows with their number.
#[derive(Clone, Copy, Debug)]
pub struct Occluders<'a>(
    /// The surfaces that block.
    pub &'a [Surface],
);

impl Visibility for Occluders<'_> {
    fn sees(&self, from: Vec3, to: Vec3) -> bool {
        !self
            .0
            .iter()
            .any(|surface| surface.polygon().crossing(from, to).is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::Rgb;

    #[test]
    fn a_plate_hides_what_is_behind_it_from_both_sides() {
        let plate = [
            Vec3::new(-1.0, -1.0, 0.0),
            Vec3::new(1.0, -1.0, 0.0),
            Vec3::new(1.0, 1.0, 0.0),
            Vec3::new(-1.0, 1.0, 0.0),
        ];
        let surfaces = [Surface::new(0, &plate, Rgb::BLACK).unwrap()];
        let occluders = Occluders(&surfaces);
        let (above, below) = (Vec3::Z, -Vec3::Z);
        assert!(!occluders.sees(above, below));
        assert!(!occluders.sees(below, above));
        assert!(
            occluders.sees(above, Vec3::ZERO),
            "a surface hides its own points"
        );
        assert!(occluders.sees(above + Vec3::X * 3.0, below + Vec3::X * 3.0));
    }
}
