//! Tagged radiosity and relighting for firmware and low-end renderers.
//!
//! A static diffuse scene is linear in its lights. This crate solves its global illumination once,
//! with every quantum of energy tagged by the light it came from, packs each light's
//! contribution into 8-bit codes, and afterwards relights the scene by a weighted sum. No std, no
//! allocation, no unsafe code: the caller lends all memory, and full storage is an error that
//! names its limit. Conventions: metres, right-handed, linear Rec. 709 RGB, radians, `f32`.
//!
//! Modules in the order in which data flows through them; each names only those above it:
//!
//! * [`math`], [`color`], [`geometry`]: float functions, linear RGB, polygons;
//! * [`scene`]: surfaces and luminaires, checked once;
//! * [`mesh`]: faces, patches that shoot, elements that receive;
//! * [`visibility`], [`form_factor`], [`luminaire`]: who sees whom, and how much of it;
//! * [`refine`]: tagged progressive refinement;
//! * [`code`], [`atlas`]: values as 8-bit codes, and all of them as bytes in flash;
//! * [`relight`], [`tone`], `draw`: atlas times mix, on a display.
//!
//! ```
//! use glam::Vec3;
//! use relume::color::Rgb;
//! use relume::mesh::{MeshStorage, Spacing, subdivide};
//! use relume::refine::{FixedStorage, Refinement};
//! use relume::scene::{Emission, Scene, Surface};
//! use relume::visibility::Occluders;
//!
//! // A grey floor and a lamp one metre above it that faces down.
//! let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
//! let floor = corners.map(|(x, y)| Vec3::new(x, y, 0.0));
//! let lamp = corners.map(|(x, y)| Vec3::new(y, x, 1.0));
//! let emission = Emission { light: 0, share: Rgb::WHITE };
//! let surfaces = [
//!     Surface::new(0, &floor, Rgb::splat(0.5))?,
//!     Surface::new(1, &lamp, Rgb::BLACK)?.emitting(1, emission)?,
//! ];
//! let scene = Scene::new(&surfaces, &[], 1)?;
//!
//! let mut meshed = MeshStorage::<2, 2, 16>::new();
//! let spacing = Spacing { patch: 1.0, element: 0.25 };
//! subdivide(&scene, spacing, |_, _| true, &mut meshed)?;
//! let mesh = meshed.mesh();
//!
//! let mut memory = FixedStorage::<1, 2, 16, 0>::new();
//! let mut refinement = Refinement::new(mesh, scene.lights(), 1e-3, memory.storage())?;
//! let mut row = [0.0; 16];
//! while let Some(patch) = refinement.next_shooter() {
//!     relume::form_factor::row(&mesh, patch, &Occluders(&surfaces), &mut row);
//!     refinement.shoot(patch, &row)?;
//! }
//! let middle = refinement.irradiance(5, 0);
//! assert!((0.2..0.25).contains(&middle.g));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::indexing_slicing,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic
)]
#![cfg_attr(
    test,
    allow(
        clippy::indexing_slicing,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic
    )
)]

pub mod math;

pub mod color;

pub mod geometry;

pub mod scene;

pub mod mesh;

pub mod visibility;

pub mod form_factor;

pub mod luminaire;

pub mod refine;

pub mod code;

pub mod atlas;

pub mod relight;

pub mod tone;

#[cfg(feature = "draw")]
pub mod draw;
