//! Error against time and work, for ways to bake that are published and for ours.
//!
//! Two built-in scenes of about a thousand elements are baked in all ways; the program's default and the
//! best of the shooting ways are baked at other mesh sizes as well, and stored in fewer bits. Every way
//! solves the same mesh through the same refinement ([`Meshed`]); it differs in what fills its rows and in
//! when it stops. Everything is timed on one thread, after meshing, the fastest of a few turns, so that
//! times compare work and not how well it is shared out.
//!
//! *Work* does not depend on the machine: a ray that is cast, a polygon that is seen from a point (what
//! stands before it cut away) and a pixel that is painted count one each, though they are not equally
//! dear. Direct light of luminaires is the same for all and left out.
//!
//! Errors are those of [`truth`], by light: against dense solutions and traced means of the same elements, and
//! against traced irradiance at points, which the mesh answers with its element's value. Dense solutions take
//! exact clip rows, so they are blind to the error of those; paths are not.

mod report;
mod stored;
mod ways;

use std::ops::ControlFlow;

use glam::{DVec3, Vec3};
use relume::atlas::AtlasError;
use relume::color::Rgb;
use relume::geometry::from_unit_square;
use relume::mesh::Side;
use relume::scene::SceneError;

use super::truth::{self, Errors, Truth, TruthError, element_receivers};
use crate::bake::{BakeError, Meshed, Settings};
use crate::builtin::{Builtin, BuiltinError, PaperLamps, cornell_box, paper_room};
use crate::mesh::Locator;
use crate::noise;
use crate::pack::PackError;
use crate::reference::path_trace::Receiver;
use crate::solution::Solution;
use ways::{Run, Way};

pub use report::{Cost, Judge, Line};
pub use stored::Storage;
pub use ways::{Family, Work};

/// How much is spent on the measurement itself.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Times that each way is timed, unless it takes long; the fastest counts.
    pub turns: u32,
    /// Paths for each element, and a quarter of those for each point.
    pub paths: u32,
    /// Mesh sizes besides the usual one, as factors on its lengths.
    pub sizes: &'static [f32],
}

impl Default for Effort {
    fn default() -> Self {
        Self {
            turns: 3,
            paths: 4000,
            sizes: &[2.0, 0.5, FINEST],
        }
    }
}

/// The finest mesh, one in so many of whose elements holds a point.
const FINEST: f32 = 0.25;
const POINT_STEP: usize = 37;

/// Why a study failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AccuracyError {
    /// A built-in scene was refused.
    #[error(transparent)]
    Builtin(#[from] BuiltinError),
    /// A bake failed.
    #[error(transparent)]
    Bake(#[from] BakeError),
    /// A truth could not be found.
    #[error(transparent)]
    Truth(#[from] TruthError),
    /// A scene has an illegal tag.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A result could not be packed.
    #[error(transparent)]
    Pack(#[from] PackError),
    /// A packed result could not be read.
    #[error(transparent)]
    Atlas(#[from] AtlasError),
    /// There is no thread to work on.
    #[error("starting a thread: {0}")]
    Thread(#[from] rayon::ThreadPoolBuildError),
}

/// Everything that was measured, scene by scene.
#[derive(Clone, Debug)]
pub struct Accuracy {
    /// The ways on the usual mesh, then ours on others.
    pub measured: Vec<Measured>,
    /// How exact the dense solutions are themselves.
    pub references: Vec<Reference>,
}

/// Errors of the dense solutions of a scene against traced means.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Name of the scene.
    pub scene: &'static str,
    /// Patches shoot.
    pub dense_patch: Errors,
    /// Elements shoot.
    pub dense_element: Errors,
}

/// One way to bake one mesh and to store the result: what it cost and how exact it is.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Name of the scene.
    pub scene: &'static str,
    /// The kind of method.
    pub family: Family,
    /// Its parameter.
    pub variant: String,
    /// How the result is stored.
    pub storage: Storage,
    /// True for what the program does unless told otherwise, on the usual mesh.
    pub is_default: bool,
    /// True for ways that are measured at all mesh sizes.
    pub is_ours: bool,
    /// Longest edge of an element, m.
    pub element: f32,
    /// Elements of the mesh.
    pub elements: usize,
    /// Patches, after division.
    pub patches: usize,
    /// Lights of the scene.
    pub lights: usize,
    /// What was done.
    pub work: Work,
    /// Wall time on one thread, s.
    pub seconds: f64,
    /// The part of it that went into rows, s; `None` where elements gather.
    pub row_seconds: Option<f64>,
    /// Errors against truths of the same elements, on the usual mesh.
    pub elementwise: Option<Elementwise>,
    /// Errors against traced irradiance at points.
    pub pointwise: Errors,
}

/// Errors against truths of the same elements.
#[derive(Clone, Debug)]
pub struct Elementwise {
    /// Against the dense solution in which patches shoot.
    pub dense_patch: Errors,
    /// Against the one in which elements shoot.
    pub dense_element: Errors,
    /// Against traced means.
    pub monte_carlo: Errors,
}

/// A built-in scene with the lengths that make a thousand elements, m.
struct Subject {
    name: &'static str,
    builtin: Builtin,
    patch: f32,
    element: f32,
}

fn subjects() -> Result<[Subject; 2], BuiltinError> {
    Ok([
        Subject {
            name: "paper room",
            builtin: paper_room(PaperLamps::Eight)?,
            patch: 1.0,
            element: 0.25,
        },
        Subject {
            name: "Cornell box",
            builtin: cornell_box()?,
            patch: 0.2,
            element: 0.05,
        },
    ])
}

impl Subject {
    fn meshed(&self, size: f32) -> Result<Meshed<'_>, BakeError> {
        let (patch, element) = (self.patch * size, self.element * size);
        Meshed::new(&self.builtin.scene, Some(patch), Some(element), &mut |_| {
            ControlFlow::Continue(())
        })
    }
}

/// Measures everything; `tell` hears what is being done.
///
/// # Errors
/// [`AccuracyError`]; built-in scenes cause none.
pub fn measure(effort: Effort, tell: &mut dyn FnMut(&str)) -> Result<Accuracy, AccuracyError> {
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut timed = |meshed: &Meshed, way: &Way, name: &str| {
        tell(&format!("{name}: {}, {}", way.family.name(), way.variant));
        one_thread.install(|| ways::fastest(meshed, way, effort.turns))
    };
    let (mut measured, mut references) = (Vec::new(), Vec::new());
    for subject in &subjects()? {
        let name = subject.name;
        let points = Points::new(subject, effort)?;
        let usual = subject.meshed(1.0)?;
        let truths = Truths::new(subject, &usual, effort)?;
        references.push(truths.reference(name));
        let ways = ways::ways(&Settings::default(), usual.mesh());
        for way in &ways {
            let run = timed(&usual, way, name)?;
            for storage in Storage::of(way) {
                measured.push(entry(
                    subject,
                    1.0,
                    way,
                    &run,
                    *storage,
                    &points,
                    Some(&truths),
                )?);
            }
        }
        for size in effort.sizes {
            let other = subject.meshed(*size)?;
            for way in ways.iter().filter(|way| way.is_ours) {
                let run = timed(&other, way, name)?;
                for storage in Storage::of(way) {
                    measured.push(entry(subject, *size, way, &run, *storage, &points, None)?);
                }
            }
        }
    }
    Ok(Accuracy {
        measured,
        references,
    })
}

fn entry(
    subject: &Subject,
    size: f32,
    way: &Way,
    run: &Run,
    storage: Storage,
    points: &Points,
    truths: Option<&Truths>,
) -> Result<Measured, AccuracyError> {
    let solution = &run.solution;
    let contributions = storage.stored(solution)?;
    let lights = solution.lights.len();
    Ok(Measured {
        scene: subject.name,
        family: way.family,
        variant: way.variant.clone(),
        storage,
        is_default: way.is_default && truths.is_some() && storage == Storage::F32,
        is_ours: way.is_ours,
        element: subject.element * size,
        elements: solution.mesh.elements.len(),
        patches: solution.mesh.patches.len(),
        lights,
        work: run.work,
        seconds: run.seconds,
        row_seconds: run.row_seconds,
        elementwise: truths.map(|truths| truths.errors(lights, &contributions)),
        pointwise: points.errors(solution, &contributions),
    })
}

/// Truths of the elements of the usual mesh.
struct Truths {
    dense_patch: Truth,
    dense_element: Truth,
    monte_carlo: Truth,
}

impl Truths {
    fn new(subject: &Subject, meshed: &Meshed, effort: Effort) -> Result<Self, AccuracyError> {
        let receivers = element_receivers(&meshed.mesh().view());
        let scene = &subject.builtin.scene;
        Ok(Self {
            dense_patch: truth::dense_patch(meshed)?,
            dense_element: truth::dense_element(meshed)?,
            monte_carlo: truth::traced(scene, &receivers, effort.paths, 1)?,
        })
    }

    fn reference(&self, scene: &'static str) -> Reference {
        let against_paths = |dense: &Truth| {
            let found = |element: usize, light: usize| {
                let value = dense.values[element][light].irradiance;
                value.map(|channel| channel as f32)
            };
            self.monte_carlo.errors(found)
        };
        Reference {
            scene,
            dense_patch: against_paths(&self.dense_patch),
            dense_element: against_paths(&self.dense_element),
        }
    }

    fn errors(&self, lights: usize, contributions: &[Rgb]) -> Elementwise {
        let found =
            |element: usize, light: usize| contributions[element * lights + light].to_array();
        Elementwise {
            dense_patch: self.dense_patch.errors(found),
            dense_element: self.dense_element.errors(found),
            monte_carlo: self.monte_carlo.errors(found),
        }
    }
}

/// Points, one anywhere in each of some elements of the finest mesh.
struct Points {
    truth: Truth,
    at: Vec<(u32, Side, Vec3)>,
}

impl Points {
    fn new(subject: &Subject, effort: Effort) -> Result<Self, AccuracyError> {
        let finest = subject.meshed(FINEST)?;
        let mesh = finest.mesh().view();
        let (mut at, mut receivers) = (Vec::new(), Vec::new());
        for (cell, seed) in mesh.elements.iter().step_by(POINT_STEP).zip(0..) {
            let place = || {
                let face = mesh.element_face(cell)?;
                let outline = mesh.element_polygon(cell)?;
                let anywhere = [2 * seed, 2 * seed + 1].map(noise::unit);
                let (point, _) = from_unit_square(&outline, anywhere.into());
                let towards: DVec3 = outline.normal().as_dvec3();
                let receiver = Receiver::point(point.as_dvec3(), towards)?;
                Some(((face.surface, face.side, point), receiver))
            };
            if let Some((place, receiver)) = place() {
                at.push(place);
                receivers.push((receiver, f64::from(cell.area)));
            }
        }
        let scene = &subject.builtin.scene;
        Ok(Self {
            truth: truth::traced(scene, &receivers, effort.paths / 4, 2)?,
            at,
        })
    }

    fn errors(&self, solution: &Solution, contributions: &[Rgb]) -> Errors {
        let locator = Locator::new(solution.mesh.view());
        let lights = solution.lights.len();
        let elements = self.at.iter().map(|(surface, side, point)| {
            let element = locator.element(*surface, *side, *point);
            element.map(|element| element as usize * lights)
        });
        let elements: Vec<Option<usize>> = elements.collect();
        self.truth.errors(|point, light| {
            let value = elements[point].map(|start| contributions[start + light]);
            value.unwrap_or_default().to_array()
        })
    }
}
