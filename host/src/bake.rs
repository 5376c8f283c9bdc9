//! The bake: mesh, form factors by many threads, tagged refinement, contributions.
//!
//! The refinement is the solver's own ([`relume::refine`]); the host fills its rows in parallel
//! and asks a [`Bvh`] who sees whom, which gives the bits that the solver alone would give.

use std::ops::ControlFlow;

use rayon::prelude::*;
use relume::color::Rgb;
use relume::form_factor::{self, Shooter};
use relume::luminaire;
use relume::mesh::{Mesh, MeshError, Spacing};
use relume::refine::{Block, PatchState, RefineError, Refinement, Storage};
use relume::scene::{Luminaire, Scene, SceneError};
use relume::visibility::{Occluders, Visibility};
use thiserror::Error;

use crate::bvh::Bvh;
use crate::mesh::{self, BuildError, OwnedMesh};
use crate::scene::OwnedScene;
use crate::solution::{Solution, SolutionLight};

/// Lanes of a block of lights on the host.
const LANES: usize = 8;

/// Receivers that one task fills.
const CHUNK: usize = 64;

/// Most bytes of state, and most bytes of kept rows, that a bake takes.
const STATE_BYTES: usize = 6 << 30;
const ROW_BYTES: usize = 4 << 30;

/// Who evaluates the rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// The host, in parallel, with a tree of boxes.
    #[default]
    Host,
    /// The solver alone, serially, by brute force: what a device does.
    Device,
}

impl Method {
    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Host => "host",
            Self::Device => "device",
        }
    }
}

/// What to bake, how finely, and when to stop.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Longest edge of a patch, in the scene's units; `None` for the rule of [`mesh::spacing`].
    pub patch: Option<f32>,
    /// Longest edge of an element.
    pub element: Option<f32>,
    /// Residual to reach, above zero.
    pub residual: f32,
    /// Stop after so many distinct rows, or so many shots of a plain refinement.
    pub shots: Option<u32>,
    /// As published: no row is kept and no ambient term is added.
    pub plain: bool,
    /// Keep direct and indirect light apart.
    pub split_direct: bool,
    /// Who evaluates the rows.
    pub method: Method,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            patch: None,
            element: None,
            residual: 1e-4,
            shots: None,
            plain: false,
            split_direct: false,
            method: Method::Host,
        }
    }
}

/// How far a bake has come.
#[derive(Clone, Copy, Debug)]
pub enum Progress {
    /// Looking for the faces that light reaches, then lighting them by luminaires: nothing to return
    /// yet.
    Meshing {
        /// Parts of the scene that were looked at, or luminaires that were lit.
        done: usize,
        /// All of them.
        parts: usize,
    },
    /// Evaluating rows: what is known so far makes a solution.
    Shooting {
        /// Rows evaluated so far.
        rows: u32,
        /// Patches of the mesh.
        patches: usize,
        /// Largest residual over the lights.
        residual: f32,
    },
}

/// Why a bake cannot be done.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BakeError {
    /// A tag is out of range.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The scene cannot be divided so.
    #[error("{0}; ask for longer patches and elements (--patch, --element)")]
    Mesh(MeshError),
    /// No surface reflects, so that nothing can be lit.
    #[error("no surface reflects light: give a material a reflectance (Kd, base colour) above 0")]
    NothingReflects,
    /// No element receives light.
    #[error(
        "light reaches no surface: turn lamps so that their front (vertices counter-clockwise) faces \
         the scene, and hang other lights in front of surfaces, not on them"
    )]
    NothingLit,
    /// The watcher broke before there was anything to return.
    #[error("interrupted before the first row")]
    Interrupted,
    /// The refinement refuses the input.
    #[error(transparent)]
    Refine(#[from] RefineError),
    /// There is no light.
    #[error("the scene has no light: give a material an emission (Ke), or add one with --lights")]
    NoLight,
    /// State and result would not fit into memory.
    #[error(
        "{elements} elements x {lights} lights need {gib:.1} GiB; ask for longer elements \
         (--element) or fewer lights"
    )]
    Memory {
        /// Elements of the mesh.
        elements: usize,
        /// Lights of the scene.
        lights: usize,
        /// What they would take.
        gib: f64,
    },
}

impl From<BuildError> for BakeError {
    fn from(error: BuildError) -> Self {
        match error {
            BuildError::Mesh(error) => Self::Mesh(error),
            BuildError::Interrupted => Self::Interrupted,
        }
    }
}

/// Bakes a scene. `watch` is called before every row; when it breaks, what is known so far is
/// finished and returned, as `shots` would. It is called while the mesh is made as well, where
/// there is nothing to return yet: [`BakeError::Interrupted`].
///
/// # Errors
/// [`BakeError`] when the scene is not fit to be baked.
pub fn bake(
    scene: &OwnedScene,
    settings: &Settings,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Solution, BakeError> {
    if scene.lights.is_empty() {
        return Err(BakeError::NoLight);
    }
    let centred = mesh::centred(scene);
    let view = centred.view()?;
    if view.surfaces().iter().all(|s| s.reflectance().is_black()) {
        return Err(BakeError::NothingReflects);
    }
    let spacing = mesh::spacing(&view, settings.patch, settings.element);
    let bvh = Bvh::for_scene(&view);
    let mesh = mesh::build(scene, &view, spacing, &bvh, &mut |done, parts| {
        watch(Progress::Meshing { done, parts })
    })?;
    if mesh.elements.is_empty() {
        return Err(BakeError::NothingLit);
    }
    let mut memory = Memory::new(&mesh, scene.lights.len(), settings)?;
    let mut refinement = Refinement::<LANES>::new(
        mesh.view(),
        view.lights(),
        settings.residual,
        memory.storage(),
    )?;
    for (light, tag) in scene.lights.iter().zip(0..) {
        refinement.set_importance(tag, light.importance)?;
    }
    match settings.method {
        Method::Host => refine(
            &mut refinement,
            &view,
            mesh.view(),
            &Parallel(&bvh),
            settings,
            watch,
        )?,
        Method::Device => {
            let serial = Serial(Occluders(view.surfaces()));
            refine(
                &mut refinement,
                &view,
                mesh.view(),
                &serial,
                settings,
                watch,
            )?;
        }
    }
    Ok(solution(scene, settings, spacing, &mesh, &refinement))
}

/// Fills rows, one after the other, from one thread or many.
trait RowFiller {
    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]);
    fn patch(&self, mesh: &Mesh, patch: u32, row: &mut [f32]);
}

struct Serial<'a>(Occluders<'a>);

impl RowFiller for Serial<'_> {
    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]) {
        luminaire::fill(mesh, luminaire, far, 0, &self.0, row);
    }

    fn patch(&self, mesh: &Mesh, patch: u32, row: &mut [f32]) {
        form_factor::row(mesh, patch, &self.0, row);
    }
}

struct Parallel<'a, V>(&'a V);

impl<V: Visibility + Sync> RowFiller for Parallel<'_, V> {
    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]) {
        in_chunks(row, |first, part| {
            luminaire::fill(mesh, luminaire, far, first, self.0, part);
        });
    }

    fn patch(&self, mesh: &Mesh, patch: u32, row: &mut [f32]) {
        let Some(polygon) = mesh.patch_polygon(patch) else {
            row.fill(0.0);
            return;
        };
        let shooter = Shooter::new(polygon);
        in_chunks(row, |first, part| {
            form_factor::fill(mesh, &shooter, first, self.0, part);
        });
        form_factor::conserve(mesh, polygon.area(), row);
    }
}

/// Every value depends on its own receiver alone, so the split does not change the bits.
fn in_chunks(row: &mut [f32], fill: impl Fn(u32, &mut [f32]) + Sync) {
    row.par_chunks_mut(CHUNK)
        .enumerate()
        .for_each(|(index, part)| fill((index * CHUNK) as u32, part));
}

/// Direct light of the luminaires, then rows until the residual, the shots or the watcher ends it.
fn refine(
    refinement: &mut Refinement<LANES>,
    scene: &Scene,
    mesh: Mesh,
    filler: &impl RowFiller,
    settings: &Settings,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<(), BakeError> {
    let mut row = vec![0.0; mesh.elements.len()];
    let far = luminaire::far(scene);
    let luminaires = scene.luminaires();
    for (luminaire, done) in luminaires.iter().zip(0..) {
        let progress = Progress::Meshing {
            done,
            parts: luminaires.len(),
        };
        if watch(progress).is_break() {
            return Err(BakeError::Interrupted);
        }
        filler.luminaire(&mesh, luminaire, far, &mut row);
        refinement.illuminate(luminaire.light(), luminaire.share(), &row)?;
    }
    // Asking for the next shooter shoots known rows, so both ways to stop come after it: a bake
    // that is interrupted gives the bits of one that was told to stop there.
    let shooting = |refinement: &Refinement<LANES>| Progress::Shooting {
        rows: refinement.rows_evaluated(),
        patches: mesh.patches.len(),
        residual: refinement.residual(),
    };
    while let Some(patch) = refinement.next_shooter() {
        if settings
            .shots
            .is_some_and(|limit| refinement.rows_evaluated() >= limit)
        {
            break;
        }
        if watch(shooting(refinement)).is_break() {
            break;
        }
        filler.patch(&mesh, patch, &mut row);
        refinement.shoot(patch, &row)?;
    }
    // A wish to stop that came while known rows were shot is heard here.
    let _ = watch(shooting(refinement));
    refinement.finish();
    Ok(())
}

/// The memory that a refinement borrows.
struct Memory {
    irradiance: Vec<[[f32; LANES]; 3]>,
    direct: Vec<[[f32; LANES]; 3]>,
    unshot: Vec<[[f32; LANES]; 3]>,
    patches: Vec<PatchState>,
    blocks: Vec<Block<LANES>>,
    rows: Vec<f32>,
}

impl Memory {
    fn new(mesh: &OwnedMesh, lights: usize, settings: &Settings) -> Result<Self, BakeError> {
        let blocks = lights.div_ceil(LANES);
        let (n, p) = (mesh.elements.len(), mesh.patches.len());
        let copies = if settings.split_direct { 2 } else { 1 };
        // Lanes of the refinement and values of the solution, both 12 bytes a light.
        let bytes = (copies * 2 * n + p) as f64 * (blocks * LANES * 12) as f64;
        if bytes > STATE_BYTES as f64 {
            return Err(BakeError::Memory {
                elements: n,
                lights,
                gib: bytes / f64::from(1 << 30),
            });
        }
        let zero = [[0.0; LANES]; 3];
        let rows = if settings.plain {
            0
        } else {
            p.min(ROW_BYTES / 4 / n.max(1))
        };
        Ok(Self {
            irradiance: vec![zero; n * blocks],
            direct: vec![zero; if settings.split_direct { n * blocks } else { 0 }],
            unshot: vec![zero; p * blocks],
            patches: vec![PatchState::EMPTY; p],
            blocks: vec![Block::EMPTY; blocks],
            rows: vec![0.0; rows * n],
        })
    }

    fn storage(&mut self) -> Storage<'_, LANES> {
        Storage {
            irradiance: &mut self.irradiance,
            direct: &mut self.direct,
            unshot: &mut self.unshot,
            patches: &mut self.patches,
            blocks: &mut self.blocks,
            rows: &mut self.rows,
        }
    }
}

/// Reads the contributions out of the refinement; what is still unshot enters as ambient light.
fn solution(
    scene: &OwnedScene,
    settings: &Settings,
    spacing: Spacing,
    mesh: &OwnedMesh,
    refinement: &Refinement<LANES>,
) -> Solution {
    let lights = scene.lights.len() as u32;
    let elements = mesh.elements.len() as u32;
    // What is left of a light that has shot its share and met nothing will meet nothing either.
    let is_lost = |light: u32| {
        let meets = |element| refinement.irradiance(element, light) != Rgb::BLACK;
        refinement.light_residual(light) <= settings.residual && !(0..elements).any(meets)
    };
    let ambient: Vec<Rgb> = (0..lights)
        .map(|light| {
            if settings.plain || is_lost(light) {
                Rgb::BLACK
            } else {
                refinement.ambient(light)
            }
        })
        .collect();
    let collect = |value: &dyn Fn(u32, u32) -> Rgb| -> Vec<Rgb> {
        (0..elements)
            .flat_map(|element| (0..lights).map(move |light| (element, light)))
            .map(|(element, light)| value(element, light))
            .collect()
    };
    Solution {
        surfaces: scene.surfaces.iter().map(|s| *s.polygon()).collect(),
        mesh: mesh::returned(mesh, scene),
        lights: scene
            .lights
            .iter()
            .zip(0..)
            .map(|(light, tag)| SolutionLight {
                name: light.name.clone(),
                emission: light.emission,
                residual: refinement.light_residual(tag),
            })
            .collect(),
        contributions: collect(&|element, light| {
            refinement.irradiance(element, light) + ambient[light as usize]
        }),
        direct: settings
            .split_direct
            .then(|| collect(&|element, light| refinement.direct(element, light))),
        rows: refinement.rows_evaluated(),
        spacing,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Light;
    use glam::Vec3;
    use relume::scene::{Emission, Source, Surface};

    /// A room from -2 to 2 with a closed box on its floor, a lamp and a point light; `at` is its
    /// middle, and every coordinate a multiple of 1/64.
    fn room(at: Vec3) -> OwnedScene {
        let closed = |middle: Vec3, half: f32| {
            [Vec3::X, Vec3::Y, Vec3::Z]
                .into_iter()
                .flat_map(|axis| [axis, -axis])
                .map(move |out| {
                    let (u, v) = out.any_orthonormal_pair();
                    let corners = [out - u - v, out - u + v, out + u + v, out + u - v];
                    corners.map(|corner| at + middle + corner * half)
                })
        };
        let walls = closed(Vec3::ZERO, 2.0).chain(closed(Vec3::new(0.5, -1.5, 0.25), 0.5));
        let mut surfaces: Vec<Surface> = walls
            .zip(0..)
            .map(|(wall, index)| Surface::new(index, &wall, Rgb::splat(0.5)).unwrap())
            .map(Surface::two_sided)
            .collect();
        let lamp = [(-1.0, -1.0), (-0.5, -1.0), (-0.5, -0.5), (-1.0, -0.5)];
        let lamp = lamp.map(|(x, z)| at + Vec3::new(x, 1.875, z));
        let emission = Emission {
            light: 0,
            share: Rgb::WHITE,
        };
        let lamp = Surface::new(12, &lamp, Rgb::BLACK).unwrap();
        surfaces.push(lamp.emitting(12, emission).unwrap());
        let position = at + Vec3::new(0.5, 0.75, 0.5);
        let light = |name: &str| Light {
            name: name.to_owned(),
            emission: Rgb::WHITE,
            importance: 1.0,
        };
        OwnedScene {
            textures: vec![None; surfaces.len()],
            surfaces,
            luminaires: vec![Luminaire::new(1, Rgb::WHITE, Source::Point { position }).unwrap()],
            lights: vec![light("lamp"), light("bulb")],
        }
    }

    const COARSE: Settings = Settings {
        patch: Some(1.0),
        element: Some(0.5),
        residual: 1e-4,
        shots: None,
        plain: false,
        split_direct: false,
        method: Method::Host,
    };

    #[test]
    fn a_scene_far_from_the_origin_has_the_faces_and_the_light_of_one_at_home() {
        let bake =
            |scene: &OwnedScene| bake(scene, &COARSE, &mut |_| ControlFlow::Continue(())).unwrap();
        let home = bake(&room(Vec3::ZERO));
        // One side of each wall; one of each of the box's, and none of that on the floor; the lamp.
        assert_eq!(home.mesh.faces.len(), 6 + 5 + 1);
        for far in [10.0, 100.0, 1e3, 1e4, 1e5] {
            for at in [Vec3::splat(far), Vec3::new(0.0, -far, 0.0)] {
                let scene = room(at);
                let away = bake(&scene);
                assert!(away.contributions == home.contributions, "{at}");
                assert_eq!(away.mesh.elements, home.mesh.elements, "{at}");
                for face in &away.mesh.faces {
                    let own = *scene.surfaces[face.surface as usize].polygon();
                    let outlines = [own, own.flipped()];
                    assert!(outlines.contains(&face.polygon), "{at}: {face:?}");
                }
            }
        }
    }

    #[test]
    fn who_breaks_off_gets_nothing_before_the_first_row_and_what_is_known_after_it() {
        let scene = room(Vec3::ZERO);
        let is_row = |progress: &Progress| matches!(progress, Progress::Shooting { .. });
        // How often the watcher is asked before the first row.
        let mut early = 0;
        let whole = bake(&scene, &COARSE, &mut |progress| {
            early += usize::from(!is_row(&progress));
            ControlFlow::Continue(())
        });
        assert!(early >= 2, "parts of the scene, and a luminaire: {early}");
        for patience in 0..early + 10 {
            let mut asked = 0;
            let part = bake(&scene, &COARSE, &mut |_| {
                asked += 1;
                if asked > patience {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            });
            if patience < early {
                assert!(matches!(part, Err(BakeError::Interrupted)), "{patience}");
                assert_eq!(asked, patience + 1, "it went on");
                continue;
            }
            let part = part.unwrap();
            let told = Settings {
                shots: Some(part.rows),
                ..COARSE
            };
            let told = bake(&scene, &told, &mut |_| ControlFlow::Continue(()));
            assert!(part == told.unwrap() && part != *whole.as_ref().unwrap());
        }
    }
}
