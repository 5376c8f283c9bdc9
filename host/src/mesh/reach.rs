//! Which faces light reaches, directly or by any number of bounces.
//!
//! A face is reached when it emits, when a part of it receives direct light, or when a walk from
//! it, ray by ray from surface to surface, comes to a point that does. Walks go through points, not
//! parts, so a floor that is lit around a closed box does not light the inside of the box. Each
//! part, as large as a patch or the default patch, whichever is larger, starts 32 walks of up to 16
//! rays. Assumption: a face that all of them miss gets too little light to matter.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relume::form_factor::Shooter;
use relume::geometry::{Polygon, from_unit_square, gauss_points};
use relume::luminaire;
use relume::mesh::{Mesh, MeshError, Side, Spacing, is_face, subdivide};
use relume::scene::Scene;
use relume::visibility::Visibility;

use super::OwnedMesh;
use crate::bvh::{Bvh, Hit};
use crate::noise;

/// Walks that start at each part.
const WALKS: u64 = 32;

/// Rays of a walk.
const LONGEST_WALK: u64 = 16;

/// Points of lamps that a point on a walk looks at.
const GLANCES: u64 = 4;

/// The sides of surfaces that light reaches.
#[derive(Debug)]
pub struct ReachedFaces(Vec<[bool; 2]>);

impl ReachedFaces {
    /// True when light reaches this side, or starts from it.
    pub fn contains(&self, surface: u32, side: Side) -> bool {
        let sides = self.0.get(surface as usize);
        sides.is_some_and(|sides| sides[side_index(side)])
    }
}

const fn side_index(side: Side) -> usize {
    match side {
        Side::Front => 0,
        Side::Back => 1,
    }
}

/// Finds the faces that light reaches.
///
/// # Errors
/// [`MeshError`] when the parts would be too many.
pub fn reached_faces(
    scene: &Scene,
    spacing: Spacing,
    bvh: &Bvh,
) -> Result<ReachedFaces, MeshError> {
    let mut parts = OwnedMesh::default();
    let length = spacing.patch.max(super::spacing(scene, None, None)?.patch);
    let coarse = Spacing {
        patch: length,
        element: length,
    };
    subdivide(scene, coarse, |_, _| true, &mut parts)?;
    let mesh = parts.view();
    let surroundings = Surroundings::new(&mesh, scene, bvh);

    let mut sides = vec![[false; 2]; scene.surfaces().len()];
    let reached: Vec<bool> = (0..mesh.patches.len())
        .into_par_iter()
        .map(|part| surroundings.reaches(&mesh, part as u32))
        .collect();
    for (part, reached) in mesh.patches.iter().zip(reached) {
        let face = &mesh.faces[part.face as usize];
        sides[face.surface as usize][side_index(face.side)] |= reached || face.emission.is_some();
    }
    Ok(ReachedFaces(sides))
}

/// A point on a side of a surface.
#[derive(Clone, Copy)]
struct Place {
    position: Vec3,
    normal: Vec3,
}

/// A scene as a walker sees it.
struct Surroundings<'a> {
    scene: &'a Scene<'a>,
    bvh: &'a Bvh,
    lamps: Vec<Polygon>,
    shooters: Vec<Shooter>,
    far: f32,
}

impl<'a> Surroundings<'a> {
    fn new(mesh: &Mesh, scene: &'a Scene<'a>, bvh: &'a Bvh) -> Self {
        let emits = |part: &u32| mesh.patch_emission(*part).is_some();
        let lamps: Vec<Polygon> = (0..mesh.patches.len() as u32)
            .filter(emits)
            .filter_map(|part| mesh.patch_polygon(part))
            .collect();
        Self {
            scene,
            bvh,
            shooters: lamps.iter().map(|lamp| Shooter::new(*lamp)).collect(),
            lamps,
            far: luminaire::far(scene),
        }
    }

    /// True when light comes to a part, directly or along one of its walks.
    fn reaches(&self, mesh: &Mesh, part: u32) -> bool {
        let Some(polygon) = mesh.patch_polygon(part) else {
            return false;
        };
        self.lights_directly(&polygon) || self.walks_lead_to_light(&polygon, part)
    }

    fn lights_directly(&self, polygon: &Polygon) -> bool {
        let luminaires = self.scene.luminaires();
        self.shooters
            .iter()
            .any(|lamp| lamp.form_factor(polygon, self.bvh) > 0.0)
            || luminaires
                .iter()
                .any(|l| luminaire::irradiance(l.source(), polygon, self.far, self.bvh) > 0.0)
    }

    fn walks_lead_to_light(&self, polygon: &Polygon, part: u32) -> bool {
        let points = gauss_points(polygon);
        (0..WALKS).any(|walk| {
            let seed = (u64::from(part) * WALKS + walk) * LONGEST_WALK;
            let mut place = Place {
                position: points[walk as usize % points.len()].position,
                normal: polygon.normal(),
            };
            for step in 0..LONGEST_WALK {
                let seed = (seed + step) * (2 + 3 * GLANCES);
                match self.next(place, seed) {
                    None => return false,
                    Some(next) if self.is_lit(next, seed + 2) => return true,
                    Some(next) => place = next,
                }
            }
            false
        })
    }

    /// Where a cosine-weighted ray ends; `None` when it escapes or is absorbed.
    fn next(&self, place: Place, seed: u64) -> Option<Place> {
        let (u, v) = place.normal.any_orthonormal_pair();
        let (share, angle) = (noise::unit(seed), TAU * noise::unit(seed + 1));
        let across = u * angle.cos() + v * angle.sin();
        let ray = across * share.sqrt() + place.normal * (1.0 - share).sqrt();
        let end = place.position + ray * self.far;
        let Hit {
            surface,
            fraction,
            front,
        } = self.bvh.nearest(place.position, end)?;
        let surface = &self.scene.surfaces()[surface as usize];
        let side = if front { Side::Front } else { Side::Back };
        let reflects = is_face(surface, side) && !surface.reflectance().is_black();
        let normal = surface.polygon().normal();
        reflects.then(|| Place {
            position: place.position + ray * (self.far * fraction),
            normal: if front { normal } else { -normal },
        })
    }

    /// True when a point gets direct light: from every luminaire asked, and from some lamps.
    fn is_lit(&self, place: Place, seed: u64) -> bool {
        let Place { position, normal } = place;
        let luminaires = self.scene.luminaires();
        let count = self.lamps.len() as f32;
        luminaires
            .iter()
            .any(|l| luminaire::at_point(l.source(), position, normal, self.far, self.bvh) > 0.0)
            || (!self.lamps.is_empty()
                && (0..GLANCES).any(|glance| {
                    let seed = seed + 3 * glance;
                    let lamp = &self.lamps[(noise::unit(seed) * count) as usize];
                    let at = Vec2::new(noise::unit(seed + 1), noise::unit(seed + 2));
                    let (point, _) = from_unit_square(lamp, at);
                    let ray = point - position;
                    ray.dot(normal) > 0.0
                        && ray.dot(lamp.normal()) < 0.0
                        && self.bvh.sees(position, point)
                }))
    }
}
