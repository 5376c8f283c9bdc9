//! Which faces light reaches, directly or by any number of bounces.
//!
//! Light casts rays from every lamp and luminaire and marks the *lit points* where they end. A face
//! is reached when it emits, when a part of it receives direct light, or when two of the walks from
//! that part, ray by ray from surface to surface, come to a point that sees a lit point or a lamp.
//! Walks go through points, not parts, so a floor that is lit around a closed box does not light the
//! inside of the box; two, because rounding lets one walk in ten thousand through an edge. Each
//! part, as large as a patch or the default patch, whichever is larger, starts 32 walks of up to 16
//! rays. Work is bounded however many lights there are: of lamps' patches, and of luminaires, 4096 cast
//! rays and a part looks at 256; a place on a walk looks at 16 luminaires. Assumption: a face that all
//! of them miss gets too little light to matter.

use std::f32::consts::TAU;
use std::ops::ControlFlow;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relume::form_factor::Shooter;
use relume::geometry::{Polygon, from_unit_square, gauss_points};
use relume::luminaire;
use relume::mesh::{Face, Mesh, MeshError, Side, Spacing, is_face, subdivide};
use relume::scene::{Scene, Source};

use super::{BuildError, OwnedMesh};
use crate::bvh::{Bvh, Caster, Hit, lifted};
use crate::noise;

/// Walks that start at each part.
pub(super) const WALKS: u64 = 32;

/// Rays of a walk.
const LONGEST_WALK: u64 = 16;

/// Walks of a part that must come to light.
const WITNESSES: usize = 2;

/// Lit points, and points of lamps, that a point on a walk looks at.
const GLANCES: u64 = 4;

/// Patches of lamps, and luminaires, that a part looks at.
const LIGHTS_PER_PART: usize = 256;

/// Luminaires that a place on a walk looks at.
const LIGHTS_PER_PLACE: usize = 16;

/// Patches of lamps, and luminaires, that cast rays.
const LIGHTS_THAT_CAST: usize = 4096;

/// Parts that are looked at before the watcher is asked again: some tenths of a second at worst.
const PARTS_AT_ONCE: usize = 64;

/// Rays that light casts from each luminaire, and from each patch of a lamp.
const CASTS: u64 = 64;

/// Form factor below which a lamp is out of sight: rounding leaves slivers between blockers.
const SLIVER: f32 = 1e-6;

/// By how much a point is drawn from its polygon's outline towards the middle, away from edges.
const INWARDS: f32 = 1e-4;

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

/// Finds the faces that light reaches. `watch` is told the parts that are done and their number; when
/// it breaks, the search ends.
///
/// # Errors
/// [`BuildError`] when the parts would be too many, or the watcher broke.
pub fn reached_faces(
    scene: &Scene,
    spacing: Spacing,
    bvh: &Bvh,
    watch: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<ReachedFaces, BuildError> {
    let parts = coarse_parts(scene, spacing)?;
    let mesh = parts.view();
    let surroundings = Surroundings::new(&mesh, scene, bvh);

    // Lamps start light; what reflects nothing stores nothing, so nothing is gained by leaving it out.
    let reflects = |face: &Face| {
        !scene.surfaces()[face.surface as usize]
            .reflectance()
            .is_black()
    };
    let starts_reached = |face: &Face| face.emission.is_some() || !reflects(face);
    let mut reached: Vec<bool> = mesh.faces.iter().map(starts_reached).collect();
    let face_of = |part: usize| mesh.patches[part].face as usize;
    let count = mesh.patches.len();
    for first in (0..count).step_by(PARTS_AT_ONCE) {
        if watch(first, count).is_break() {
            return Err(BuildError::Interrupted);
        }
        let lit: Vec<usize> = (first..count.min(first + PARTS_AT_ONCE))
            .into_par_iter()
            .filter(|part| !reached[face_of(*part)] && surroundings.reaches(&mesh, *part as u32))
            .collect();
        for part in lit {
            reached[face_of(part)] = true;
        }
    }

    let mut sides = vec![[false; 2]; scene.surfaces().len()];
    for (face, reached) in mesh.faces.iter().zip(reached) {
        sides[face.surface as usize][side_index(face.side)] = reached;
    }
    Ok(ReachedFaces(sides))
}

/// Every side of every surface in parts as large as a patch, or the default patch where that is larger.
fn coarse_parts(scene: &Scene, spacing: Spacing) -> Result<OwnedMesh, MeshError> {
    let length = spacing.patch.max(super::spacing(scene, None, None).patch);
    let coarse = Spacing {
        patch: length,
        element: length,
    };
    let mut parts = OwnedMesh::default();
    subdivide(scene, coarse, |_, _| true, &mut parts)?;
    Ok(parts)
}

/// Sine of the angle to a surface below which nothing is exchanged: the two sides of one plane do not
/// see each other, whatever rounding says.
const GRAZING: f32 = 1e-3;

/// A point on a side of a surface.
#[derive(Clone, Copy)]
pub(super) struct Place {
    position: Vec3,
    normal: Vec3,
    /// Where rays start.
    start: Vec3,
}

impl Place {
    /// A point on the front of a polygon.
    pub(super) fn new(polygon: &Polygon, position: Vec3) -> Self {
        Self {
            position,
            normal: polygon.normal(),
            start: lifted(polygon, position),
        }
    }
}

/// A scene as a walker sees it.
pub(super) struct Surroundings<'a> {
    scene: &'a Scene<'a>,
    bvh: &'a Bvh,
    lamps: Vec<Polygon>,
    shooters: Vec<Shooter>,
    lit: Vec<Place>,
    far: f32,
}

impl<'a> Surroundings<'a> {
    /// A scene that is to be divided into these lengths.
    pub(super) fn of(
        scene: &'a Scene<'a>,
        spacing: Spacing,
        bvh: &'a Bvh,
    ) -> Result<Self, MeshError> {
        let parts = coarse_parts(scene, spacing)?;
        Ok(Self::new(&parts.view(), scene, bvh))
    }

    fn new(mesh: &Mesh, scene: &'a Scene<'a>, bvh: &'a Bvh) -> Self {
        let emits = |part: &u32| mesh.patch_emission(*part).is_some();
        let lamps: Vec<Polygon> = (0..mesh.patches.len() as u32)
            .filter(emits)
            .filter_map(|part| mesh.patch_polygon(part))
            .collect();
        let mut surroundings = Self {
            scene,
            bvh,
            shooters: lamps.iter().map(|lamp| Shooter::new(*lamp)).collect(),
            lamps,
            lit: Vec::new(),
            far: luminaire::far(scene),
        };
        surroundings.lit = surroundings.cast_light();
        surroundings
    }

    /// Where the rays of lamps, point and spot lights end. Sun and sky light what sees them, and
    /// walks that escape ask them themselves.
    fn cast_light(&self) -> Vec<Place> {
        let mut lit = Vec::new();
        let mut caster = self.bvh.caster();
        for (number, lamp) in some_of(&self.lamps, LIGHTS_THAT_CAST, 0) {
            for cast in 0..CASTS {
                let seed = (number * CASTS + cast) * 4;
                let at = Vec2::new(noise::unit(seed), noise::unit(seed + 1));
                let start = Place::new(lamp, from_unit_square(lamp, at).0);
                lit.extend(self.next(&mut caster, start, seed + 2));
            }
        }
        for (number, luminaire) in some_of(self.scene.luminaires(), LIGHTS_THAT_CAST, 0) {
            let (position, axis, least) = match *luminaire.source() {
                Source::Point { position } => (position, Vec3::Z, -1.0),
                Source::Spot {
                    position,
                    direction,
                    outer,
                    ..
                } => (position, direction, outer.cos()),
                Source::Sun { .. } | Source::Sky => continue,
            };
            let (u, v) = axis.any_orthonormal_pair();
            for cast in 0..CASTS {
                let seed = !((number * CASTS + cast) * 2);
                let along = 1.0 - noise::unit(seed) * (1.0 - least);
                let angle = TAU * noise::unit(seed - 1);
                let across = (1.0 - along * along).max(0.0).sqrt();
                let ray = axis * along + (u * angle.cos() + v * angle.sin()) * across;
                lit.extend(self.end_of(&mut caster, position, ray));
            }
        }
        lit
    }

    /// True when light comes to a part, along its walks or directly; the walks find out sooner.
    fn reaches(&self, mesh: &Mesh, part: u32) -> bool {
        let Some(polygon) = mesh.patch_polygon(part) else {
            return false;
        };
        self.walks_lead_to_light(&polygon, part) || self.lights_directly(&polygon, part)
    }

    fn lights_directly(&self, polygon: &Polygon, part: u32) -> bool {
        let (most, seed) = (LIGHTS_PER_PART, u64::from(part));
        some_of(&self.shooters, most, seed)
            .any(|(_, lamp)| lamp.form_factor(polygon, self.bvh) > SLIVER)
            || some_of(self.scene.luminaires(), most, seed)
                .any(|(_, l)| luminaire::irradiance(l.source(), polygon, self.far, self.bvh) > 0.0)
    }

    fn walks_lead_to_light(&self, polygon: &Polygon, part: u32) -> bool {
        let points = gauss_points(polygon);
        self.is_reached(u64::from(part), |walk| {
            Place::new(polygon, points[walk as usize % points.len()].position)
        })
    }

    /// True when enough of the walks that `start` somewhere, by their number of [`WALKS`], come to light.
    pub(super) fn is_reached(&self, seed: u64, start: impl Fn(u64) -> Place) -> bool {
        let mut caster = self.bvh.caster();
        let witnesses = (0..WALKS)
            .filter(|walk| self.leads_to_light(&mut caster, start(*walk), seed * WALKS + walk));
        witnesses.take(WITNESSES).count() == WITNESSES
    }

    /// True when a walk from a place comes to light.
    fn leads_to_light(&self, caster: &mut Caster, start: Place, walk: u64) -> bool {
        let mut place = start;
        for step in 0..LONGEST_WALK {
            let seed = (walk * LONGEST_WALK + step) * (2 + 4 * GLANCES);
            if self.is_lit(caster, place, seed + 2) {
                return true;
            }
            match self.next(caster, place, seed) {
                None => return false,
                Some(next) => place = next,
            }
        }
        false
    }

    /// Where a cosine-weighted ray ends; `None` when it escapes or is absorbed.
    fn next(&self, caster: &mut Caster, place: Place, seed: u64) -> Option<Place> {
        let (u, v) = place.normal.any_orthonormal_pair();
        let (share, angle) = (noise::unit(seed), TAU * noise::unit(seed + 1));
        let across = u * angle.cos() + v * angle.sin();
        let ray = across * share.sqrt() + place.normal * (1.0 - share).sqrt();
        self.end_of(caster, place.start, ray)
    }

    /// Where a ray meets a side that reflects; `None` when it escapes or is absorbed.
    fn end_of(&self, caster: &mut Caster, from: Vec3, ray: Vec3) -> Option<Place> {
        let Hit {
            surface,
            distance,
            front,
        } = caster.nearest(from, ray)?;
        let surface = &self.scene.surfaces()[surface as usize];
        let side = if front { Side::Front } else { Side::Back };
        let reflects = is_face(surface, side) && !surface.reflectance().is_black();
        let polygon = surface.polygon();
        let polygon = if front { *polygon } else { polygon.flipped() };
        let position = from + ray * distance;
        let inside = position + (polygon.center() - position) * INWARDS;
        reflects.then(|| Place::new(&polygon, inside))
    }

    /// True when a point gets light: from a luminaire, a lamp or a lit point.
    fn is_lit(&self, caster: &mut Caster, place: Place, seed: u64) -> bool {
        let Place {
            position, normal, ..
        } = place;
        some_of(self.scene.luminaires(), LIGHTS_PER_PLACE, seed).any(|(_, l)| {
            luminaire::at_point(l.source(), position, normal, self.far, 1, self.bvh) > 0.0
        }) || (0..GLANCES).any(|glance| {
            let seed = seed + 4 * glance;
            let lamp = pick(&self.lamps, seed).map(|lamp| {
                let at = Vec2::new(noise::unit(seed + 1), noise::unit(seed + 2));
                Place::new(lamp, from_unit_square(lamp, at).0)
            });
            let lit = pick(&self.lit, seed + 3).copied();
            lamp.is_some_and(|lamp| exchange(caster, place, lamp))
                || lit.is_some_and(|lit| exchange(caster, place, lit))
        })
    }
}

/// True when two places face and see each other.
fn exchange(caster: &mut Caster, a: Place, b: Place) -> bool {
    let ray = b.position - a.position;
    let least = GRAZING * ray.length();
    ray.dot(a.normal) > least && ray.dot(b.normal) < -least && caster.sees(a.start, b.start)
}

/// At most `most` of `items`, with their numbers, evenly spread; all of them if they are no more.
fn some_of<T>(items: &[T], most: usize, seed: u64) -> impl Iterator<Item = (u64, &T)> {
    let step = items.len().div_ceil(most).max(1);
    let first = (noise::unit(seed) * step as f32) as usize;
    (0..).zip(items).skip(first).step_by(step)
}

fn pick<T>(items: &[T], seed: u64) -> Option<&T> {
    items.get((noise::unit(seed) * items.len() as f32) as usize)
}
