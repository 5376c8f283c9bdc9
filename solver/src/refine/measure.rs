//! What a refinement can tell at any time: residuals, ambient terms, irradiances, counts.

use super::lanes::{address, lane_of, sum};
use super::{Lanes, PatchState, Refinement};
use crate::color::Rgb;

impl<const K: usize> Refinement<'_, K> {
    /// The largest residual of all lights.
    #[must_use]
    pub fn residual(&self) -> f32 {
        (0..self.storage.blocks.len())
            .flat_map(|block| self.block_residuals(block, |_| true))
            .fold(0.0, f32::max)
    }

    /// True when no light has a residual above the goal by the patches that `admit` lets pass.
    ///
    /// While refinement goes on, the first block of lights mostly says so already.
    pub(super) fn is_done(&self, admit: impl Fn(&PatchState) -> bool) -> bool {
        let above = |residual: &f32| *residual > self.residual;
        (0..self.storage.blocks.len())
            .all(|block| !self.block_residuals(block, &admit).iter().any(above))
    }

    /// Residual of one light; 0 for a light that emits nothing or does not exist.
    #[must_use]
    pub fn light_residual(&self, light: u32) -> f32 {
        let (block, lane) = address::<K>(light);
        let residuals = self.block_residuals(block, |_| true);
        residuals.get(lane).copied().unwrap_or(0.0)
    }

    fn block_residuals(&self, block: usize, admit: impl Fn(&PatchState) -> bool) -> [f32; K] {
        let count = self.mesh.patches.len();
        let mut power = [0.0; K];
        let unshot = self.storage.unshot.get(block * count..).unwrap_or_default();
        let patches = self.mesh.patches.iter().zip(self.storage.patches.iter());
        for ((patch, state), [r, g, b]) in patches.zip(unshot) {
            if admit(state) {
                let channels = r.iter().zip(g).zip(b);
                for (total, ((r, g), b)) in power.iter_mut().zip(channels) {
                    *total += (r + g + b) * patch.area;
                }
            }
        }
        let emitted = self.storage.blocks.get(block).map(|b| b.emitted);
        for (value, emitted) in power.iter_mut().zip(emitted.unwrap_or([0.0; K])) {
            *value = if emitted > 0.0 { *value / emitted } else { 0.0 };
        }
        power
    }

    /// Ambient irradiance of a light: what its unshot power would add on average, W/m2.
    #[must_use]
    pub fn ambient(&self, light: u32) -> Rgb {
        let count = self.mesh.patches.len();
        let (block, lane) = address::<K>(light);
        let unshot = self.storage.unshot.get(block * count..).unwrap_or_default();
        let mut power = Rgb::BLACK;
        for (patch, lanes) in self.mesh.patches.iter().zip(unshot) {
            power += lane_of(lanes, lane) * patch.area;
        }
        let (mut area, mut reflecting) = (0.0, Rgb::BLACK);
        for element in self.mesh.elements {
            area += element.area;
            reflecting += element.reflectance * element.area;
        }
        if area <= 0.0 {
            return Rgb::BLACK;
        }
        let landing = if self.area_shot > 0.0 {
            (self.area_landed / self.area_shot) as f32
        } else {
            1.0
        };
        let term = |power: f32, reflecting: f32| {
            power.max(0.0) / area * landing / (1.0 - landing * reflecting / area).max(f32::EPSILON)
        };
        Rgb::new(
            term(power.r, reflecting.r),
            term(power.g, reflecting.g),
            term(power.b, reflecting.b),
        )
    }

    /// Estimated relative L1 error of a light's irradiance without the ambient term: what is missing
    /// by the ambient term, over that and what has arrived. 0 for a light that sends nothing.
    ///
    /// It sees the light that has not been shot, not the size of patches and elements.
    #[must_use]
    pub fn light_error(&self, light: u32) -> f32 {
        let (mut area, mut arrived) = (0.0, 0.0);
        for (element, id) in self.mesh.elements.iter().zip(0..) {
            area += element.area;
            arrived += element.area * sum(self.irradiance(id, light));
        }
        let missing = sum(self.ambient(light)) * area;
        if missing > 0.0 {
            missing / (missing + arrived)
        } else {
            0.0
        }
    }

    /// Irradiance of an element by a light at unit emission, W/m2, without the ambient term.
    #[must_use]
    pub fn irradiance(&self, element: u32, light: u32) -> Rgb {
        self.lookup(self.storage.irradiance, element, light)
    }

    /// The direct part of it; zero when direct light is not kept apart.
    #[must_use]
    pub fn direct(&self, element: u32, light: u32) -> Rgb {
        self.lookup(self.storage.direct, element, light)
    }

    fn lookup(&self, lanes: &[Lanes<K>], element: u32, light: u32) -> Rgb {
        if element as usize >= self.mesh.elements.len() || light >= self.lights {
            return Rgb::BLACK;
        }
        let (block, lane) = address::<K>(light);
        let index = block * self.mesh.elements.len() + element as usize;
        // The solve for known rows leaves a rounding below zero in the dark.
        lanes.get(index).map_or(Rgb::BLACK, |lanes| {
            lane_of(lanes, lane).map(|value| value.max(0.0))
        })
    }

    /// Rows handed in so far; without row storage a patch may count more than once.
    #[must_use]
    pub const fn rows_evaluated(&self) -> u32 {
        self.rows_evaluated
    }
}
