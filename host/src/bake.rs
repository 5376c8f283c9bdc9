//! The bake: mesh, form factors by many threads, tagged refinement, contributions.
//!
//! The refinement is the solver's own ([`relume::refine`]); the host fills its rows in parallel
//! and asks a [`Bvh`] who sees whom, which gives the bits that the solver alone would give.

use std::ops::ControlFlow;

use relume::color::Rgb;
use relume::luminaire;
use relume::mesh::{Mesh, MeshError, Spacing};
use relume::refine::{Block, Choice, PatchState, RefineError, Refinement, RowStorage, Storage};
use relume::scene::{Scene, SceneError};
use relume::visibility::Occluders;
use thiserror::Error;

use crate::bvh::Bvh;
use crate::mesh::{self, Direct, OwnedMesh, Split, split};
use crate::rows::{Parallel, RowFiller, Serial};
use crate::scene::OwnedScene;
use crate::solution::{Solution, SolutionLight};

/// Lanes of a block of lights on the host.
const LANES: usize = 8;

/// Most bytes of state, and most bytes of kept rows, that a bake takes.
const STATE_BYTES: usize = 6 << 30;
const ROW_BYTES: usize = 4 << 30;

/// Most bytes of lamps' rows that are held before the refinement starts.
const LAMP_BYTES: usize = 1 << 30;

/// Most shooters that patches are divided into, for each of them.
const SHOOTERS_PER_PATCH: usize = 3;

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
    /// Variation of direct light inside a patch, relative, above which patches are divided.
    pub variation: f64,
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
            variation: 0.15,
            shots: None,
            plain: false,
            split_direct: false,
            method: Method::Host,
        }
    }
}

/// How far a bake has come.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Rows evaluated so far.
    pub rows: u32,
    /// Patches of the mesh.
    pub patches: usize,
    /// Largest residual over the lights.
    pub residual: f32,
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
    Mesh(#[from] MeshError),
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

/// Bakes a scene. `watch` is called before every row; when it breaks, what is known so far is
/// finished and returned, as `shots` would.
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
    let view = scene.view()?;
    let spacing = mesh::spacing(&view, settings.patch, settings.element);
    let bvh = Bvh::for_scene(&view);
    let mesh = mesh::build(scene, &view, spacing, &bvh)?;
    let patches = mesh.patches.len();
    match settings.method {
        Method::Host => {
            let rows = |mesh: &Mesh| Parallel::new(mesh, &bvh);
            refine(scene, &view, mesh, rows, settings, watch)
        }
        Method::Device => {
            let rows = |_: &Mesh| Serial(Occluders(&scene.surfaces));
            refine(scene, &view, mesh, rows, settings, watch)
        }
    }
    .map(|solved| solution(scene, spacing, patches, solved))
}

/// What a refinement leaves behind.
struct Solved {
    mesh: OwnedMesh,
    contributions: Vec<Rgb>,
    direct: Option<Vec<Rgb>>,
    residuals: Vec<f32>,
    rows: u32,
}

/// Direct light, shooters where it varies, then rows until the residual, the shots or the watcher ends it.
fn refine<F: RowFiller>(
    scene: &OwnedScene,
    view: &Scene,
    mesh: OwnedMesh,
    filler: impl Fn(&Mesh) -> F,
    settings: &Settings,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Solved, BakeError> {
    let lights = scene.lights.len();
    let light = DirectLight::evaluate(view, &mesh, &filler(&mesh.view()), settings, watch);
    let mut first: Vec<u32> = (0..mesh.patches.len() as u32).collect();
    let mut mesh = mesh;
    if light.is_complete && !settings.plain {
        let irradiance = light.by_element(view, &mesh);
        let irradiance = irradiance.as_slice();
        let direct = Direct { irradiance, lights };
        let budget = SHOOTERS_PER_PATCH * mesh.patches.len();
        Split { mesh, first, .. } = split(&mesh, direct, settings.variation, budget);
    }

    let mut memory = Memory::new(&mesh, lights, settings)?;
    let storage = memory.storage();
    let goal = settings.residual;
    let mut refinement = Refinement::<LANES>::new(mesh.view(), view.lights(), goal, storage)?;
    if settings.plain {
        refinement.set_choice(Choice::Power);
    }
    for (light, tag) in scene.lights.iter().zip(0..) {
        refinement.set_importance(tag, light.importance)?;
    }
    for (luminaire, row) in view.luminaires().iter().zip(&light.luminaires) {
        refinement.illuminate(luminaire.light(), luminaire.share(), row)?;
    }
    for (patch, row) in &light.lamps {
        refinement.shoot(first[*patch as usize], row)?;
    }
    drop(light);
    let filler = filler(&mesh.view());
    let mut row = vec![0.0; mesh.elements.len()];
    while let Some(patch) = refinement.next_shooter() {
        let rows = refinement.rows_evaluated();
        if settings.shots.is_some_and(|limit| rows >= limit)
            || watch(progress(rows, &mesh, refinement.residual())).is_break()
        {
            break;
        }
        filler.patch(&mesh.view(), patch, &mut row);
        refinement.shoot(patch, &row)?;
    }
    refinement.finish();
    Ok(read_out(&mesh, lights, settings, &refinement))
}

fn progress(rows: u32, mesh: &OwnedMesh, residual: f32) -> Progress {
    Progress {
        rows,
        patches: mesh.patches.len(),
        residual,
    }
}

/// Rows of all that emits.
struct DirectLight {
    /// Direct irradiance by each luminaire of the scene.
    luminaires: Vec<Vec<f32>>,
    /// Emitting patches and their rows, as many as the shots allow.
    lamps: Vec<(u32, Vec<f32>)>,
    /// True when no lamp is missing.
    is_complete: bool,
}

impl DirectLight {
    fn evaluate(
        scene: &Scene,
        mesh: &OwnedMesh,
        filler: &impl RowFiller,
        settings: &Settings,
        watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Self {
        let view = mesh.view();
        let n = mesh.elements.len();
        let far = luminaire::far(scene);
        let luminaires = scene.luminaires().iter().map(|luminaire| {
            let mut row = vec![0.0; n];
            filler.luminaire(&view, luminaire, far, &mut row);
            row
        });
        let mut light = Self {
            luminaires: luminaires.collect(),
            lamps: Vec::new(),
            is_complete: false,
        };
        // As published, and where the rows of the lamps are too many to be held twice, they are
        // shot like any other.
        let emitting = (0..mesh.patches.len() as u32).filter(|p| view.patch_emission(*p).is_some());
        if settings.plain || emitting.clone().count() * n * 4 > LAMP_BYTES {
            return light;
        }
        for patch in emitting {
            let rows = light.lamps.len() as u32;
            if settings.shots.is_some_and(|limit| rows >= limit)
                || watch(progress(rows, mesh, 1.0)).is_break()
            {
                return light;
            }
            let mut row = vec![0.0; n];
            filler.patch(&view, patch, &mut row);
            light.lamps.push((patch, row));
        }
        light.is_complete = true;
        light
    }

    /// Sum over the channels of the direct irradiance, element by element, light by light.
    fn by_element(&self, scene: &Scene, mesh: &OwnedMesh) -> Vec<f32> {
        let view = mesh.view();
        let lights = scene.lights() as usize;
        let mut irradiance = vec![0.0; mesh.elements.len() * lights];
        let luminaires = scene.luminaires().iter().zip(&self.luminaires);
        let luminaires = luminaires.map(|(l, row)| (l.light(), l.share(), row));
        let lamps = self.lamps.iter().filter_map(|(patch, row)| {
            let emission = view.patch_emission(*patch)?;
            Some((emission.light, emission.share, row))
        });
        for (light, share, row) in luminaires.chain(lamps) {
            let share: f32 = share.to_array().iter().sum();
            let values = irradiance.iter_mut().skip(light as usize);
            for (value, factor) in values.step_by(lights).zip(row) {
                *value += share * factor;
            }
        }
        irradiance
    }
}

/// The memory that a refinement borrows.
struct Memory {
    irradiance: Vec<[[f32; LANES]; 3]>,
    direct: Vec<[[f32; LANES]; 3]>,
    unshot: Vec<[[f32; LANES]; 3]>,
    patches: Vec<PatchState>,
    blocks: Vec<Block<LANES>>,
    factors: Vec<f32>,
    shares: Vec<Rgb>,
    sources: Vec<[[f32; LANES]; 3]>,
    sent: Vec<[[f32; LANES]; 3]>,
    work: Vec<[[f32; LANES]; 3]>,
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
            p.min(ROW_BYTES / (4 * n + 12 * p).max(1))
        };
        let known = if rows > 0 { p } else { 0 };
        Ok(Self {
            irradiance: vec![zero; n * blocks],
            direct: vec![zero; if settings.split_direct { n * blocks } else { 0 }],
            unshot: vec![zero; p * blocks],
            patches: vec![PatchState::EMPTY; p],
            blocks: vec![Block::EMPTY; blocks],
            factors: vec![0.0; rows * n],
            shares: vec![Rgb::BLACK; rows * p],
            sources: vec![zero; known * blocks],
            sent: vec![zero; known * blocks],
            work: vec![zero; 6 * known],
        })
    }

    fn storage(&mut self) -> Storage<'_, LANES> {
        Storage {
            irradiance: &mut self.irradiance,
            direct: &mut self.direct,
            unshot: &mut self.unshot,
            patches: &mut self.patches,
            blocks: &mut self.blocks,
            rows: RowStorage {
                factors: &mut self.factors,
                shares: &mut self.shares,
                sources: &mut self.sources,
                sent: &mut self.sent,
                work: &mut self.work,
            },
        }
    }
}

/// Reads the contributions out of the refinement; what is still unshot enters as ambient light.
fn read_out(
    mesh: &OwnedMesh,
    lights: usize,
    settings: &Settings,
    refinement: &Refinement<LANES>,
) -> Solved {
    let lights = lights as u32;
    let ambient: Vec<Rgb> = (0..lights)
        .map(|light| {
            if settings.plain {
                Rgb::BLACK
            } else {
                refinement.ambient(light)
            }
        })
        .collect();
    let elements = mesh.elements.len() as u32;
    let collect = |value: &dyn Fn(u32, u32) -> Rgb| -> Vec<Rgb> {
        (0..elements)
            .flat_map(|element| (0..lights).map(move |light| (element, light)))
            .map(|(element, light)| value(element, light))
            .collect()
    };
    Solved {
        contributions: collect(&|element, light| {
            refinement.irradiance(element, light) + ambient[light as usize]
        }),
        direct: settings
            .split_direct
            .then(|| collect(&|element, light| refinement.direct(element, light))),
        residuals: (0..lights).map(|l| refinement.light_residual(l)).collect(),
        rows: refinement.rows_evaluated(),
        mesh: mesh.clone(),
    }
}

fn solution(scene: &OwnedScene, spacing: Spacing, patches: usize, solved: Solved) -> Solution {
    let _ = patches;
    let lights = scene.lights.iter().zip(solved.residuals);
    Solution {
        surfaces: scene.surfaces.iter().map(|s| *s.polygon()).collect(),
        mesh: solved.mesh,
        lights: lights
            .map(|(light, residual)| SolutionLight {
                name: light.name.clone(),
                emission: light.emission,
                residual,
            })
            .collect(),
        contributions: solved.contributions,
        direct: solved.direct,
        rows: solved.rows,
        spacing,
    }
}
