//! Which faces light reaches, directly or by any number of bounces.
//!
//! Every face casts 64 rays for each patch-sized part of it, or part of the default patch's size
//! where that is larger: finer patches are no reason to look closer. A face is reached when a part
//! of it receives direct light from a lamp or luminaire, or exchanges a ray, in either direction,
//! with a face that is reached. Assumption: a face that light reaches only through an opening that
//! none of these rays finds carries too little of it to matter.

use std::collections::{BTreeSet, HashMap};
use std::f32::consts::TAU;

use glam::Vec3;
use relume::form_factor::Shooter;
use relume::geometry::{Polygon, gauss_points};
use relume::luminaire;
use relume::mesh::{Mesh, MeshError, Patch, Side, Spacing, subdivide};
use relume::scene::Scene;

use super::OwnedMesh;
use crate::bvh::{Bvh, Hit};

/// Rays from each of the four points of a part.
const RAYS_PER_POINT: u32 = 16;

/// Golden ratio: its multiples spread evenly over a circle.
const GOLDEN: f32 = 1.618_034;

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
    let exchange = exchanges(&mesh, scene, bvh);
    let mut reached = lit_directly(&mesh, scene, bvh);

    // Spread along the exchanged rays until nothing changes.
    let mut waiting: Vec<usize> = (0..reached.len()).filter(|face| reached[*face]).collect();
    while let Some(face) = waiting.pop() {
        for &other in &exchange[face] {
            if !reached[other] {
                reached[other] = true;
                waiting.push(other);
            }
        }
    }

    let mut sides = vec![[false; 2]; scene.surfaces().len()];
    for (face, reached) in mesh.faces.iter().zip(reached) {
        sides[face.surface as usize][side_index(face.side)] = reached;
    }
    Ok(ReachedFaces(sides))
}

/// For every face, the faces with which it exchanged a ray.
fn exchanges(mesh: &Mesh, scene: &Scene, bvh: &Bvh) -> Vec<BTreeSet<usize>> {
    let numbers: HashMap<(u32, Side), usize> = mesh
        .faces
        .iter()
        .enumerate()
        .map(|(number, face)| ((face.surface, face.side), number))
        .collect();
    let far = luminaire::far(scene);
    let mut exchanges = vec![BTreeSet::new(); mesh.faces.len()];
    for (patch, polygon) in patch_polygons(mesh) {
        for ray in rays(&polygon) {
            let Some(Hit { surface, front, .. }) = bvh.nearest(ray.0, ray.0 + ray.1 * far) else {
                continue;
            };
            let side = if front { Side::Front } else { Side::Back };
            if let Some(&other) = numbers.get(&(surface, side)) {
                let face = patch.face as usize;
                exchanges[face].insert(other);
                exchanges[other].insert(face);
            }
        }
    }
    exchanges
}

fn patch_polygons<'a>(mesh: &'a Mesh) -> impl Iterator<Item = (&'a Patch, Polygon)> {
    let outlines = (0..).map(|patch| mesh.patch_polygon(patch));
    mesh.patches
        .iter()
        .zip(outlines)
        .filter_map(|(patch, polygon)| Some((patch, polygon?)))
}

/// Cosine-weighted rays (origin, unit direction) from the Gauss points of a part.
fn rays(polygon: &Polygon) -> Vec<(Vec3, Vec3)> {
    let normal = polygon.normal();
    let (u, v) = normal.any_orthonormal_pair();
    let points = gauss_points(polygon);
    let count = RAYS_PER_POINT * points.len() as u32;
    let mut rays = Vec::with_capacity(count as usize);
    for index in 0..count {
        let share = (index as f32 + 0.5) / count as f32;
        let (radius, angle) = (share.sqrt(), TAU * GOLDEN * index as f32);
        let across = u * angle.cos() + v * angle.sin();
        let direction = across * radius + normal * (1.0 - share).sqrt();
        rays.push((points[index as usize % points.len()].position, direction));
    }
    rays
}

/// Faces that emit, or that a lamp or luminaire lights without a bounce.
fn lit_directly(mesh: &Mesh, scene: &Scene, bvh: &Bvh) -> Vec<bool> {
    let lamps: Vec<Shooter> = patch_polygons(mesh)
        .filter(|(patch, _)| mesh.faces[patch.face as usize].emission.is_some())
        .map(|(_, polygon)| Shooter::new(polygon))
        .collect();
    let far = luminaire::far(scene);
    let mut lit: Vec<bool> = mesh
        .faces
        .iter()
        .map(|face| face.emission.is_some())
        .collect();
    for (patch, polygon) in patch_polygons(mesh) {
        let lit = &mut lit[patch.face as usize];
        *lit = *lit
            || lamps
                .iter()
                .any(|lamp| lamp.form_factor(&polygon, bvh) > 0.0)
            || scene
                .luminaires()
                .iter()
                .any(|l| luminaire::irradiance(l.source(), &polygon, far, bvh) > 0.0);
    }
    lit
}
