//! The bake: mesh, form factors by many threads, tagged refinement, contributions.
//!
//! The refinement is the solver's own ([`relume::refine`]); the host fills its rows in parallel
//! and asks a [`Bvh`] who sees whom, which gives the bits that the solver alone would give.

use std::ops::ControlFlow;

use relume::color::Rgb;
use relume::luminaire;
use relume::mesh::{Mesh, MeshError, Spacing};
use relume::refine::{Block, PatchState, RefineError, Refinement, Storage};
use relume::scene::{Scene, SceneError};
use relume::visibility::Occluders;
use thiserror::Error;

use crate::bvh::Bvh;
use crate::mesh::{self, OwnedMesh};
use crate::rows::{Parallel, RowFiller, Serial};
use crate::scene::OwnedScene;
use crate::solution::{Solution, SolutionLight};

/// Lanes of a block of lights on the host.
const LANES: usize = 8;

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
            &Parallel::new(&mesh.view(), &bvh),
            settings,
            watch,
        )?,
        Method::Device => {
            let serial = Serial(Occluders(&scene.surfaces));
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
    for luminaire in scene.luminaires() {
        filler.luminaire(&mesh, luminaire, far, &mut row);
        refinement.illuminate(luminaire.light(), luminaire.share(), &row)?;
    }
    // Asking for the next shooter shoots known rows, so both ways to stop come after it: a bake
    // that is interrupted gives the bits of one that was told to stop there.
    while let Some(patch) = refinement.next_shooter() {
        if settings
            .shots
            .is_some_and(|limit| refinement.rows_evaluated() >= limit)
        {
            break;
        }
        let progress = Progress {
            rows: refinement.rows_evaluated(),
            patches: mesh.patches.len(),
            residual: refinement.residual(),
        };
        if watch(progress).is_break() {
            break;
        }
        filler.patch(&mesh, patch, &mut row);
        refinement.shoot(patch, &row)?;
    }
    // A wish to stop that came while known rows were shot is heard here.
    let _ = watch(Progress {
        rows: refinement.rows_evaluated(),
        patches: mesh.patches.len(),
        residual: refinement.residual(),
    });
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
    Solution {
        surfaces: scene.surfaces.iter().map(|s| *s.polygon()).collect(),
        mesh: mesh.clone(),
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
