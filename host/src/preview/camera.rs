//! A pinhole camera, and the files that describe one.
//!
//! The ray through the picture's point `(x, y)`, in pixels from the top left corner, is
//! `d = f + p (x - w/2) r + p (y - h/2) v`, with `f`, `r`, `v` the unit vectors forward, to the
//! right and down, and `p = 2 tan(fov / 2) / h` the size of a pixel at distance 1. The depth of a
//! point is its distance along `f`. Angles are radians; `fov` spans the height of the picture.

use std::io;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use serde::Deserialize;

/// Largest side of a picture, in pixels.
pub const MAX_SIDE: u32 = 16_384;

/// The vertical field of view unless one is given, in radians (40 degrees).
pub(super) const FOV: f32 = 0.7;

/// `up` and the view direction are parallel when the sine of their angle is below this: what
/// remains of `up` would be rounding.
const PARALLEL: f64 = 1e-6;

/// Where a camera stands and what it looks at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// Where the camera stands, in the scene's unit of length.
    pub eye: Vec3,
    /// The point in the middle of the picture.
    pub target: Vec3,
    /// The direction that is up in the picture; any length.
    pub up: Vec3,
    /// Vertical field of view in radians, in (0, pi).
    pub fov: f32,
}

/// Why there is no camera.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// The camera's file cannot be read.
    #[error("{}: {error}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the file system said.
        error: io::Error,
    },
    /// The camera's file is no TOML with `eye`, `target` and perhaps `up` and `fov`.
    #[error("line {line}: {message}")]
    Toml {
        /// Line of the fault, from 1.
        line: usize,
        /// What is wrong there.
        message: String,
    },
    /// The same, of a named file.
    #[error("{}: {error}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with its contents.
        error: Box<CameraError>,
    },
    /// A coordinate or an angle is NaN or infinite.
    #[error("a coordinate or the field of view is not a finite number; correct it")]
    NotFinite,
    /// Eye and target are the same point.
    #[error("eye and target are the same point; move one of them")]
    NoDirection,
    /// Up is zero or points along the view.
    #[error("up is zero or parallel to the view; choose another up")]
    NoUp,
    /// The field of view is outside (0, pi).
    #[error("the field of view {0} is outside (0, pi) radians; about 1 is usual")]
    Fov(f32),
    /// A side is zero or above [`MAX_SIDE`].
    #[error("a picture of {0} x {1} pixels; choose sides in 1..={MAX_SIDE}")]
    Size(u32, u32),
    /// There is nothing to look at.
    #[error("the scene has no surfaces to look at")]
    NothingToSee,
}

/// The file as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ViewpointFile {
    eye: [f32; 3],
    target: [f32; 3],
    #[serde(default = "upwards")]
    up: [f32; 3],
    #[serde(default = "usual_fov")]
    fov: f32,
}

fn upwards() -> [f32; 3] {
    Vec3::Y.to_array()
}

fn usual_fov() -> f32 {
    FOV
}

impl Viewpoint {
    /// Reads `eye = [x, y, z]`, `target = [x, y, z]`, `up = [x, y, z]` (default `[0, 1, 0]`) and
    /// `fov` (vertical, in radians, default 0.7) from TOML.
    ///
    /// # Errors
    /// [`CameraError::Toml`]; the values themselves are checked by [`Camera::new`].
    pub fn from_toml(text: &str) -> Result<Self, CameraError> {
        let file: ViewpointFile = toml::from_str(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start);
            let before = text.as_bytes().iter().take(start);
            CameraError::Toml {
                line: 1 + before.filter(|byte| **byte == b'\n').count(),
                message: error.message().replace('\n', " "),
            }
        })?;
        Ok(Self {
            eye: Vec3::from_array(file.eye),
            target: Vec3::from_array(file.target),
            up: Vec3::from_array(file.up),
            fov: file.fov,
        })
    }

    /// Reads the same from a file.
    ///
    /// # Errors
    /// [`CameraError::Io`] and [`CameraError::File`], with the file's name.
    pub fn from_toml_file(path: &Path) -> Result<Self, CameraError> {
        let text = std::fs::read_to_string(path).map_err(|error| CameraError::Io {
            path: path.to_owned(),
            error,
        })?;
        Self::from_toml(&text).map_err(|error| CameraError::File {
            path: path.to_owned(),
            error: Box::new(error),
        })
    }
}

/// A viewpoint and a size of picture, checked.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    eye: DVec3,
    forward: DVec3,
    right: DVec3,
    down: DVec3,
    pixel: f64,
    width: u32,
    height: u32,
}

impl Camera {
    /// Checks a viewpoint and the size of the picture in pixels.
    ///
    /// # Errors
    /// [`CameraError`] with the fault that was found first.
    pub fn new(viewpoint: Viewpoint, width: u32, height: u32) -> Result<Self, CameraError> {
        let Viewpoint {
            eye,
            target,
            up,
            fov,
        } = viewpoint;
        if ![width, height].iter().all(|s| (1..=MAX_SIDE).contains(s)) {
            return Err(CameraError::Size(width, height));
        }
        if !(eye.is_finite() && target.is_finite() && up.is_finite() && fov.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        if !(0.0 < fov && fov < std::f32::consts::PI) {
            return Err(CameraError::Fov(fov));
        }
        let [eye, target, up] = [eye, target, up].map(Vec3::as_dvec3);
        let forward = (target - eye).try_normalize();
        let forward = forward.ok_or(CameraError::NoDirection)?;
        let upright = up.try_normalize().ok_or(CameraError::NoUp)?;
        let right = forward.cross(upright);
        if right.length() < PARALLEL {
            return Err(CameraError::NoUp);
        }
        let right = right.normalize();
        Ok(Self {
            eye,
            forward,
            right,
            down: forward.cross(right),
            pixel: 2.0 * (f64::from(fov) / 2.0).tan() / f64::from(height),
            width,
            height,
        })
    }

    /// Width and height of the picture in pixels.
    #[must_use]
    pub const fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Where it stands.
    #[must_use]
    pub fn eye(&self) -> Vec3 {
        self.eye.as_vec3()
    }

    /// From the eye to a point.
    pub(super) fn towards(&self, point: Vec3) -> DVec3 {
        point.as_dvec3() - self.eye
    }

    /// The ray `d` through a point of the picture, of depth 1.
    #[must_use]
    pub fn ray(&self, x: f64, y: f64) -> DVec3 {
        let [middle_x, middle_y] = self.middle();
        let across = self.right * (x - middle_x) + self.down * (y - middle_y);
        self.forward + across * self.pixel
    }

    /// The coefficients of `normal . d = a x + b y + c`, with `d` the ray through `(x, y)`.
    pub(super) fn line(&self, normal: DVec3) -> [f64; 3] {
        let a = normal.dot(self.right) * self.pixel;
        let b = normal.dot(self.down) * self.pixel;
        let [middle_x, middle_y] = self.middle();
        [a, b, normal.dot(self.forward) - a * middle_x - b * middle_y]
    }

    /// Where a point (given from the eye) is in the picture; `None` behind the camera.
    pub(super) fn project(&self, from_eye: DVec3) -> Option<[f64; 2]> {
        let depth = from_eye.dot(self.forward);
        let [middle_x, middle_y] = self.middle();
        let scale = (depth * self.pixel).recip();
        let at = [
            middle_x + from_eye.dot(self.right) * scale,
            middle_y + from_eye.dot(self.down) * scale,
        ];
        (depth > 0.0 && at.iter().all(|v| v.is_finite())).then_some(at)
    }

    fn middle(&self) -> [f64; 2] {
        [self.width, self.height].map(|side| f64::from(side) / 2.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRONT: Viewpoint = Viewpoint {
        eye: Vec3::new(1.0, 2.0, 8.0),
        target: Vec3::new(1.0, 2.0, 0.0),
        up: Vec3::Y,
        fov: 0.8,
    };

    #[test]
    fn x_grows_to_the_right_and_y_down() {
        let camera = Camera::new(FRONT, 200, 100).unwrap();
        let at = |point: Vec3| camera.project(camera.towards(point));
        let near = |got: Option<[f64; 2]>, want: [f64; 2]| {
            let got = got.unwrap();
            assert!(
                (got[0] - want[0]).abs() < 1e-4 && (got[1] - want[1]).abs() < 1e-4,
                "{got:?}"
            );
        };
        let half = 8.0 * 0.4_f32.tan();
        near(at(FRONT.target), [100.0, 50.0]);
        near(at(FRONT.target + Vec3::Y * half), [100.0, 0.0]);
        near(at(FRONT.target + Vec3::X * half), [150.0, 50.0]);
        assert!(at(FRONT.eye + Vec3::Z).is_none());
    }

    #[test]
    fn rays_lines_and_projections_agree() {
        let view = Viewpoint {
            eye: Vec3::new(0.3, -0.2, 0.9),
            target: Vec3::new(-2.0, 1.0, 0.4),
            up: Vec3::new(0.1, 0.2, 5.0),
            fov: 1.3,
        };
        let camera = Camera::new(view, 333, 77).unwrap();
        let normal = DVec3::new(0.2, -0.7, 0.4);
        let [a, b, c] = camera.line(normal);
        for (x, y) in [(0.0, 0.0), (100.5, 33.25), (333.0, 77.0), (-50.0, 400.0)] {
            let ray = camera.ray(x, y);
            assert!((ray.dot(normal) - (a * x + b * y + c)).abs() < 1e-12);
            let [px, py] = camera.project(ray * 3.0).unwrap();
            assert!(
                (px - x).abs() < 1e-9 && (py - y).abs() < 1e-9,
                "{x} {y}: {px} {py}"
            );
        }
    }

    #[test]
    fn every_fault_has_its_own_error() {
        let with = |change: fn(&mut Viewpoint)| {
            let mut view = FRONT;
            change(&mut view);
            Camera::new(view, 64, 64).unwrap_err()
        };
        assert!(matches!(
            with(|v| v.eye.x = f32::NAN),
            CameraError::NotFinite
        ));
        assert!(matches!(
            with(|v| v.up.z = f32::INFINITY),
            CameraError::NotFinite
        ));
        assert!(matches!(
            with(|v| v.target = v.eye),
            CameraError::NoDirection
        ));
        assert!(matches!(with(|v| v.up = Vec3::Z * 3.0), CameraError::NoUp));
        assert!(matches!(with(|v| v.up = Vec3::ZERO), CameraError::NoUp));
        for fov in [0.0, -1.0, std::f32::consts::PI, 40.0] {
            let view = Viewpoint { fov, ..FRONT };
            assert!(
                matches!(Camera::new(view, 64, 64), Err(CameraError::Fov(_))),
                "{fov}"
            );
        }
        for (w, h) in [(0, 1), (1, 0), (MAX_SIDE + 1, 1), (1, u32::MAX)] {
            assert!(matches!(
                Camera::new(FRONT, w, h),
                Err(CameraError::Size(..))
            ));
        }
        assert!(Camera::new(FRONT, MAX_SIDE, 1).is_ok());
    }

    #[test]
    fn a_file_needs_eye_and_target_only() {
        let view = Viewpoint::from_toml("eye = [1, 2, 8]\ntarget = [1, 2.0, 0]\n").unwrap();
        assert_eq!(view, Viewpoint { fov: 0.7, ..FRONT });
        let text = "eye = [0,0,0]\ntarget = [1,0,0]\nup = [0,0,1]\nfov = 1.5";
        let view = Viewpoint::from_toml(text).unwrap();
        assert_eq!((view.up, view.fov), (Vec3::Z, 1.5));
    }

    #[test]
    fn a_bad_file_is_refused_with_its_line() {
        for (text, line) in [
            ("eye = [0, 0, 0]", 1),
            ("eye = [0, 0, 0]\ntarget = [0, 0]", 2),
            ("eye = [0, 0, 0]\ntarget = [0, 0, 1]\nfow = 1", 3),
            ("eye = [0, 0, 0]\n\ntarget = [0, 0, ", 3),
        ] {
            let error = Viewpoint::from_toml(text).unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("line {line}:")),
                "{text}: {error}"
            );
            assert!(!error.contains('\n'), "{error}");
        }
        let missing = Viewpoint::from_toml_file(Path::new("no/such.toml")).unwrap_err();
        assert!(
            missing.to_string().starts_with("no/such.toml: "),
            "{missing}"
        );
    }
}
