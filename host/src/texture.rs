//! Textures of reflectance: an image in linear RGB and where a surface's corners lie in it.

use std::sync::Arc;

use glam::Vec2;

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
