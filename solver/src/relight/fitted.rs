//! What a host works out of an atlas for its frames, as constants that firmware links.
//!
//! [`FrameMix::new`] and [`Finish::new`] look at every contribution and reckon with 64 bits. What they find depends on the
//! atlas, the full weights and the exposure alone, so a host may find it when firmware is built. The device then
//! takes bytes for this atlas that have its checksum, under which the host found them legal. Numbers of another atlas give
//! wrong colours, and nothing worse.

use super::frame::{Finish, FrameLight, FrameMix, Gain, Run};
use super::{Encode, RelightError};
use crate::atlas::{Atlas, AtlasError};
use crate::color::Rgb;

/// An atlas of `K` lights in exponential codes under their full weights and an exposure; its `Debug` is its Rust.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fitted<const K: usize> {
    /// Of the atlas.
    pub checksum: u32,
    /// Mantissa and power of two of every light's gains for red, green and blue.
    pub gains: [[(u16, i16); 3]; K],
    /// The same of what multiplies reflectances.
    pub shown: [(u16, i16); 3],
}

impl<const K: usize> Fitted<K> {
    /// Fits the largest weights of all lights, and an exposure, as [`FrameMix::exponential`] and [`Finish::new`] do.
    ///
    /// # Errors
    /// Those of both.
    pub fn new<T: Encode>(
        atlas: &Atlas,
        full: &[Rgb; K],
        runs: &[Run],
        exposure: f32,
        tone: &T,
    ) -> Result<Self, RelightError> {
        let mut room = [FrameLight::EMPTY; K];
        let mix = FrameMix::exponential(atlas, full, &mut room)?;
        Finish::new(atlas, &mix, runs, exposure, tone)?;
        let shown = mix.shown(runs, exposure, tone.white());
        Ok(Self {
            checksum: atlas.checksum(),
            shown: shown.ok_or(RelightError::Range)?.map(Gain::parts),
            gains: room.map(|light| light.gains().map(Gain::parts)),
        })
    }

    /// The atlas that this was fitted to; what the host checked is not checked again, and names and mesh are left out.
    ///
    /// # Errors
    /// [`AtlasError::Checksum`] for other bytes.
    pub fn atlas<'a>(&self, bytes: &'a [u8]) -> Result<Atlas<'a>, AtlasError> {
        Atlas::parse_known(bytes, self.checksum)
    }

    /// Its mix, all lights off. It has no full scale: by [`Finish::new`] it would be black.
    pub fn mix<'a>(&self, lights: &'a mut [FrameLight; K]) -> FrameMix<'a> {
        for (light, gains) in lights.iter_mut().zip(&self.gains) {
            *light = FrameLight::new(gains.map(Gain::from_parts));
        }
        FrameMix::of_lights(lights)
    }

    /// Its finish, whose runs are all elements in their order.
    ///
    /// # Errors
    /// [`RelightError::Elements`].
    pub fn finish<'a, T: Encode>(
        &self,
        atlas: &Atlas,
        runs: &'a [Run],
        tone: &'a T,
    ) -> Result<Finish<'a, T>, RelightError> {
        Finish::with_gains(atlas, runs, self.shown.map(Gain::from_parts), tone)
    }
}
