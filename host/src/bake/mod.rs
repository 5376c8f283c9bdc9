//! The bake: mesh, direct light, its bounces, contributions.
//!
//! Lamps and luminaires light the elements by rows of exact form factors ([`crate::rows`]). Then
//! elements gather all bounces by rays ([`Method::Gather`]), or patches shoot them along further rows
//! through the solver's own refinement ([`relume::refine`]), as a device does.

mod accuracy;
mod bounce;
mod direct;
mod estimate;
mod memory;
mod shoot;
mod update;

use std::ops::ControlFlow;

use relume::color::Rgb;
use relume::mesh::{Mesh, MeshError, Spacing};
use relume::refine::RefineError;
use relume::scene::{Scene, SceneError};
use relume::visibility::OccludersAndBodies;
use thiserror::Error;

use self::estimate::Senders;
use crate::bvh::Bvh;
use crate::gather::Hits;
use crate::mesh::{self, BuildError, Centred, OwnedMesh};
use crate::rows::{Parallel, RowFiller, Serial};
use crate::scene::OwnedScene;
use crate::solution::{Solution, SolutionLight};

pub use crate::solution::Method;
pub use accuracy::{MOST_BAKES, MOST_ELEMENTS};
pub use memory::Memory;
pub use update::update;

/// Lanes of a block of lights on the host.
const LANES: usize = 8;

/// Most bytes of state that a bake takes.
const STATE_BYTES: usize = 6 << 30;

/// What to bake, how finely, and when to stop.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Longest edge of a patch, in the scene's units; `None` for the rule of [`mesh::spacing`].
    pub patch: Option<f32>,
    /// Longest edge of an element.
    pub element: Option<f32>,
    /// Residual to reach, above zero.
    pub residual: f32,
    /// Stop after so many distinct rows and passes of rays, or so many shots of a plain refinement.
    pub shots: Option<u32>,
    /// As published: patches shoot, none is divided, and no row is kept.
    pub plain: bool,
    /// Estimated relative L1 error of the worst light to meet, by the length of the elements and the
    /// number of rays; `None` for elements and rays as the other settings have them.
    pub error: Option<f32>,
    /// What stands for rows that are missing in the end.
    pub missing: Missing,
    /// Relative L1 error, of the worst light, that the rays may leave.
    pub noise: f32,
    /// Relative variation of direct light inside a patch above which it is divided to shoot.
    pub variation: f64,
    /// Keep direct and indirect light apart.
    pub split_direct: bool,
    /// How light gets from element to element.
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
            error: None,
            missing: Missing::Closed,
            noise: 0.005,
            variation: 0.15,
            split_direct: false,
            method: Method::Gather,
        }
    }
}

/// What stands for rows that are missing when shooting ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    /// Nothing, as published.
    Nothing,
    /// The ambient term (Cohen et al. 1988).
    Ambient,
    /// Estimated rows ([`relume::refine::Refinement::close`]); the ambient term where memory does not hold all
    /// rows, and nothing in a plain refinement, which keeps none.
    Closed,
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
        /// Rows evaluated, and passes of rays cast, so far.
        rows: u32,
        /// The most that there will be.
        most: u32,
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
    /// An update was asked for that only a whole bake can give.
    #[error(
        "more than its lights has changed since that solution was baked, or a lamp with a shape of its own is new, or it was \
         not baked by --method gather; bake it again"
    )]
    OtherScene,
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
    Ok(bake_keeping(scene, settings, watch)?.0)
}

/// [`bake`], with what an [`update`] needs: where the rays ended, nothing where there are none.
///
/// # Errors
/// As [`bake`].
pub fn bake_keeping(
    scene: &OwnedScene,
    settings: &Settings,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<(Solution, Hits), BakeError> {
    match settings.error {
        None => {
            let scene = mesh::cut(scene, settings.patch, settings.element)?;
            Meshed::new(&scene, settings.patch, settings.element, watch)?.solve(settings, watch)
        }
        Some(goal) => accuracy::bake_to(scene, settings, goal, watch),
    }
}

/// A scene that is divided and ready to be lit.
#[derive(Debug)]
pub struct Meshed<'a> {
    scene: &'a OwnedScene,
    centred: Centred<'a>,
    spacing: Spacing,
    bvh: Bvh,
    mesh: OwnedMesh,
}

impl<'a> Meshed<'a> {
    /// Divides a scene, into patches and elements of these lengths or by the rule of [`mesh::spacing`].
    ///
    /// # Errors
    /// [`BakeError`] when the scene is not fit to be baked, or the watcher breaks.
    pub fn new(
        scene: &'a OwnedScene,
        patch: Option<f32>,
        element: Option<f32>,
        watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Self, BakeError> {
        if scene.lights.is_empty() {
            return Err(BakeError::NoLight);
        }
        let centred = mesh::centred(scene);
        let view = centred.view()?;
        if view.surfaces().iter().all(|s| s.reflectance().is_black()) {
            return Err(BakeError::NothingReflects);
        }
        let spacing = mesh::spacing(&view, patch, element);
        let bvh = Bvh::for_scene(&view);
        let mesh = mesh::build(scene, &view, spacing, &bvh, &mut |done, parts| {
            watch(Progress::Meshing { done, parts })
        })?;
        if mesh.elements.is_empty() {
            return Err(BakeError::NothingLit);
        }
        Ok(Self {
            scene,
            spacing,
            bvh,
            mesh,
            centred,
        })
    }

    /// The mesh, where it is solved: near the origin.
    #[must_use]
    pub const fn mesh(&self) -> &OwnedMesh {
        &self.mesh
    }

    /// The tree of what blocks, in the same place.
    #[must_use]
    pub const fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// The scene in the same place, as the solver sees it.
    ///
    /// # Errors
    /// [`SceneError`] when a tag is out of range.
    pub fn view(&self) -> Result<Scene<'_>, SceneError> {
        self.centred.view()
    }

    /// Solves as the settings say, and tells where the rays ended; `watch` as for [`bake`].
    ///
    /// # Errors
    /// [`BakeError`] when there is not enough memory, or the watcher breaks early.
    pub fn solve(
        &self,
        settings: &Settings,
        watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<(Solution, Hits), BakeError> {
        let baked = self.bake(settings, watch)?;
        Ok((baked.solution, baked.hits))
    }

    fn bake(
        &self,
        settings: &Settings,
        watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Baked, BakeError> {
        let view = self.view()?;
        let parallel = |mesh: &Mesh| Parallel::new(mesh, &self.bvh);
        let (surfaces, bodies) = (view.surfaces(), self.bvh.bodies());
        let occluders = OccludersAndBodies { surfaces, bodies };
        let serial = |_: &Mesh| Serial(occluders);
        self.run(settings, watch, |job, mesh| match settings.method {
            Method::Gather if !settings.plain => bounce::gather(job, mesh, &self.bvh),
            Method::Gather | Method::Rows => without_hits(shoot::refine(job, mesh, parallel)),
            Method::Device => without_hits(shoot::refine(job, mesh, serial)),
        })
    }

    /// Solves by shooting rows that `filler` fills for the mesh it is given, whatever the method.
    ///
    /// # Errors
    /// [`BakeError`] when there is not enough memory, the watcher breaks early, or a row is illegal.
    pub fn solve_with<F: RowFiller>(
        &self,
        settings: &Settings,
        filler: impl Fn(&Mesh) -> F,
        watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Solution, BakeError> {
        let rows = |job: &mut Job, mesh| without_hits(shoot::refine(job, mesh, filler));
        Ok(self.run(settings, watch, rows)?.solution)
    }

    fn run(
        &self,
        settings: &Settings,
        watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
        solve: impl FnOnce(&mut Job, OwnedMesh) -> Result<(Solved, Hits), BakeError>,
    ) -> Result<Baked, BakeError> {
        let lights = &self.scene.lights;
        check_memory(&self.mesh, lights.len(), settings)?;
        let mut job = Job {
            scene: &self.view()?,
            importances: lights.iter().map(|light| light.importance).collect(),
            settings,
            watch,
        };
        let (solved, hits) = solve(&mut job, self.mesh.clone())?;
        let senders = match settings.method {
            Method::Gather if !settings.plain => Senders::Elements,
            _ => Senders::Patches,
        };
        let (mesh, found) = (&solved.mesh, &solved.contributions);
        let seen = estimate::errors(job.scene, mesh, &self.bvh, found, senders);
        let of_mesh = seen.iter().zip(&solved.errors);
        let of_mesh = of_mesh.map(|(seen, left)| (seen * seen - left * left).max(0.0).sqrt());
        Ok(Baked {
            of_mesh: of_mesh.fold(0.0, f32::max),
            solution: solution(self.scene, settings.method, self.spacing, solved, &seen),
            hits,
        })
    }
}

/// What a bake returns.
struct Baked {
    solution: Solution,
    /// Where rays ended, if there were any.
    hits: Hits,
    /// Estimated relative L1 error of the worst light that is left to the length of the elements.
    of_mesh: f32,
}

/// Rows leave no rays behind.
fn without_hits(solved: Result<Solved, BakeError>) -> Result<(Solved, Hits), BakeError> {
    Ok((solved?, Hits::default()))
}

/// What there is to do, and who watches.
struct Job<'a> {
    scene: &'a Scene<'a>,
    importances: Vec<f32>,
    settings: &'a Settings,
    watch: &'a mut dyn FnMut(Progress) -> ControlFlow<()>,
}

impl Job<'_> {
    fn lights(&self) -> usize {
        self.scene.lights() as usize
    }

    /// True when the shots are used up, or the watcher wants no more.
    fn ends(&mut self, rows: u32, most: u32, residual: f32) -> bool {
        let progress = Progress::Shooting {
            rows,
            most,
            residual,
        };
        self.settings.shots.is_some_and(|limit| rows >= limit) || (self.watch)(progress).is_break()
    }
}

/// What a bake leaves behind, element by element and light by light.
struct Solved {
    mesh: OwnedMesh,
    contributions: Vec<Rgb>,
    direct: Option<Vec<Rgb>>,
    /// One for each element.
    exposed: Vec<f32>,
    /// One for each light.
    residuals: Vec<f32>,
    /// Relative L1 error of each light that rays or missing rows leave, estimated.
    errors: Vec<f32>,
    rows: u32,
}

/// Lanes of the refinement and values of the solution both take 12 bytes an element and light.
fn check_memory(mesh: &OwnedMesh, lights: usize, settings: &Settings) -> Result<(), BakeError> {
    let (n, p) = (mesh.elements.len(), mesh.patches.len());
    let copies = if settings.split_direct { 2 } else { 1 };
    let bytes = (copies * 2 * n + p) as f64 * (lights.div_ceil(LANES) * LANES * 12) as f64;
    if bytes > STATE_BYTES as f64 {
        return Err(BakeError::Memory {
            elements: n,
            lights,
            gib: bytes / f64::from(1 << 30),
        });
    }
    Ok(())
}

/// `seen` are the errors that places see, which know nothing of light that has not been distributed.
fn solution(
    scene: &OwnedScene,
    method: Method,
    spacing: Spacing,
    solved: Solved,
    seen: &[f32],
) -> Solution {
    let errors = solved.errors.iter().zip(seen);
    let errors = errors.map(|(left, seen)| left.max(*seen));
    let lights = scene.lights.iter().zip(solved.residuals).zip(errors);
    Solution {
        surfaces: scene.surfaces.iter().map(|s| *s.polygon()).collect(),
        luminaires: scene.luminaires.clone(),
        mesh: mesh::placed(&solved.mesh, &scene.surfaces),
        image: None,
        lights: lights
            .map(|((light, residual), error)| SolutionLight {
                name: light.name.clone(),
                emission: light.emission,
                residual,
                error,
            })
            .collect(),
        contributions: solved.contributions,
        direct: solved.direct,
        exposed: solved.exposed,
        method: match method {
            Method::Device => Method::Rows,
            Method::Gather | Method::Rows => method,
        },
        rows: solved.rows,
        spacing,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Light;
    use glam::Vec3;
    use relume::scene::{Emission, Luminaire, Source, Surface};

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
        error: None,
        missing: Missing::Closed,
        noise: 1e-9,
        variation: 0.15,
        split_direct: false,
        method: Method::Gather,
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
    fn an_element_is_exposed_but_for_what_is_under_a_box() {
        let whole = bake(&room(Vec3::ZERO), &COARSE, &mut |_| {
            ControlFlow::Continue(())
        });
        let solution = whole.unwrap();
        let mesh = solution.mesh.view();
        // Lowest and highest corner of the box's foot.
        let (low, high) = (Vec3::new(0.0, -2.0, -0.25), Vec3::new(1.0, -2.0, 0.75));
        let mut partly = 0;
        for (id, element) in mesh.elements.iter().enumerate() {
            let polygon = mesh.element_polygon(element).unwrap();
            let is_floor = polygon.vertices().iter().all(|v| v.y == -2.0);
            let [least, most] = [Vec3::min, Vec3::max]
                .map(|extreme| polygon.vertices().iter().copied().reduce(extreme).unwrap());
            let under = (most.min(high) - least.max(low)).max(Vec3::ZERO);
            let covered = if is_floor {
                under.x * under.z / polygon.area()
            } else {
                0.0
            };
            let expected = (1.0 - covered).max(0.25);
            partly += usize::from(covered > 0.0 && covered < 1.0);
            // Four standard errors of 1024 random rays; these are evener.
            let found = solution.exposed(id);
            assert!(
                (found - expected).abs() < 0.06,
                "{id}: {found} instead of {expected}"
            );
        }
        assert_eq!(partly, 4);
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
