//! The camera that is used when nobody says where to stand.
//!
//! Up is +Y, as glTF and OBJ scenes have it, unless the user says otherwise; a scene with another up
//! is turned until it is +Y. The rule, from the bounding box of what is to be seen, which lamps
//! and other black surfaces beside it only block:
//! * A side of the box (+z, -z, +x, -x) is *open* when at most a quarter of 8 x 8 parallel rays
//!   that enter through it meet a surface in the first quarter of the box.
//! * One or two open sides: a room that is cut open. Stand outside the most open one, look
//!   straight at the middle of the box, so far away that the opening fills the picture.
//! * Three or four: an object in the open. Stand outside, to the right and above, and see all.
//! * None: a closed room. Stand inside, towards one of the four corners, a little above the middle, where the mean
//!   free view is longest, and look at the middle of the box.

use glam::{Quat, Vec3};
use relume::geometry::Polygon;

use super::camera::{Camera, CameraError, FOV, Viewpoint};

/// Field of view inside a room, vertical, in radians (70 degrees).
const INDOOR_FOV: f32 = 1.22;
/// Rays along each direction of a grid.
const GRID: u16 = 8;
/// Largest share of blocked rays of an open side.
const OPEN: f32 = 0.25;
/// Room around the scene in the picture.
const MARGIN: f32 = 1.04;
/// Where an observer in a closed room may stand, as shares of the way from the middle to the
/// corner, horizontally and up.
const STANDS: [(f32, f32); 3] = [(0.85, 0.12), (0.6, 0.1), (0.3, 0.05)];
/// From where an object in the open is seen.
const OBLIQUE: Vec3 = Vec3::new(0.45, 0.4, 1.0);

/// The sides through which a room may be open, in order of preference.
const SIDES: [Vec3; 4] = [Vec3::Z, Vec3::NEG_Z, Vec3::X, Vec3::NEG_X];

/// Bounding box of some points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    min: Vec3,
    max: Vec3,
}

impl Bounds {
    /// The box around all polygons; `None` around none.
    pub(super) fn new<'a>(polygons: impl IntoIterator<Item = &'a Polygon>) -> Option<Self> {
        let points = polygons.into_iter().flat_map(|polygon| polygon.vertices());
        points
            .map(|p| Self { min: *p, max: *p })
            .reduce(|a, b| Self {
                min: a.min.min(b.min),
                max: a.max.max(b.max),
            })
    }

    /// True for the box's inside and its surface.
    pub(super) fn contains(&self, point: Vec3) -> bool {
        self.min.cmple(point).all() && point.cmple(self.max).all()
    }

    fn middle(&self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    fn half(&self) -> Vec3 {
        (self.max - self.min) * 0.5
    }

    /// The corners, from the middle.
    fn corners(&self) -> [Vec3; 8] {
        let sign = |i: usize, bit: usize| if i & bit == 0 { 1.0 } else { -1.0 };
        std::array::from_fn(|i| self.half() * Vec3::new(sign(i, 1), sign(i, 2), sign(i, 4)))
    }
}

impl Camera {
    /// The camera at [`Viewpoint::fit`] for a picture of `width` x `height` pixels.
    ///
    /// # Errors
    /// [`CameraError::NothingToSee`] without polygons, [`CameraError::Size`].
    pub fn fit(polygons: &[Polygon], width: u32, height: u32) -> Result<Self, CameraError> {
        let aspect = width as f32 / height.max(1) as f32;
        let view =
            Viewpoint::fit(polygons, polygons, Vec3::Y, aspect).ok_or(CameraError::NothingToSee)?;
        Self::new(view, width, height)
    }
}

impl Viewpoint {
    /// Where to stand by default to see the polygons `shown` among all `surfaces`, for a picture
    /// `aspect` times as wide as high; `None` when nothing is shown. `up` may have any length; sides
    /// are named as if it were +Y, which it is taken for when it has none.
    ///
    /// A room with one or two open sides (of +z, -z, +x, -x) is seen straight through the most
    /// open one, a closed room from the inner corner with the longest mean free view, and what is
    /// open on more sides from outside and above. A side is open when at most a quarter of the
    /// rays that enter there meet a surface in the first quarter of the scene's bounding box.
    #[must_use]
    pub fn fit(shown: &[Polygon], surfaces: &[Polygon], up: Vec3, aspect: f32) -> Option<Self> {
        let up = up.try_normalize().unwrap_or(Vec3::Y);
        let upright = Quat::from_rotation_arc(up, Vec3::Y);
        let surfaces = turned(surfaces, upright);
        let bounds = Bounds::new(&turned(shown, upright))?;
        let blocked = SIDES.map(|side| (blocked_share(&surfaces, bounds, side), side));
        let open = blocked.iter().filter(|(share, _)| *share <= OPEN);
        let most_open = open.clone().min_by(|a, b| a.0.total_cmp(&b.0));
        let view = match (open.count(), most_open) {
            (1 | 2, Some((_, side))) => outside(bounds, *side, aspect),
            (3.., _) => outside(bounds, OBLIQUE.normalize(), aspect),
            _ => inside(&surfaces, bounds, aspect),
        };
        let back = upright.inverse();
        Some(Self {
            eye: back * view.eye,
            target: back * view.target,
            up,
            ..view
        })
    }
}

/// The polygons after a rotation; what rounding leaves without an area is left out.
fn turned(polygons: &[Polygon], rotation: Quat) -> Vec<Polygon> {
    let turned = polygons.iter().filter_map(|polygon| {
        let vertices = polygon.vertices().iter().map(|vertex| rotation * *vertex);
        Polygon::new(&vertices.collect::<Vec<_>>()).ok()
    });
    turned.collect()
}

/// True when something stands between two points.
fn is_blocked(polygons: &[Polygon], from: Vec3, to: Vec3) -> bool {
    polygons.iter().any(|p| p.crossing(from, to).is_some())
}

/// Middles of the cells of a square grid, each coordinate in (-1, 1).
fn grid() -> impl Iterator<Item = (f32, f32)> {
    let place = |i: u16| (2.0 * f32::from(i) + 1.0) / f32::from(GRID) - 1.0;
    (0..GRID).flat_map(move |row| (0..GRID).map(move |column| (place(column), place(row))))
}

/// Share of the rays through a side of the box that are stopped in its first quarter.
fn blocked_share(polygons: &[Polygon], bounds: Bounds, side: Vec3) -> f32 {
    let half = bounds.half();
    let across = Vec3::Y.cross(side) * half;
    let stopped = grid().filter(|(x, y)| {
        let place = bounds.middle() + across * *x + Vec3::Y * half * *y;
        let [before, behind] = [1.1, 0.5].map(|depth| place + side * half * depth);
        is_blocked(polygons, before, behind)
    });
    stopped.count() as f32 / f32::from(GRID * GRID)
}

/// From outside, so far away that the whole box is in the picture.
///
/// A corner `c` of the box, from its middle, is in the picture when its offset on the screen is at
/// most `tan(fov / 2)` (`aspect` times that sideways) per unit of its depth `distance - c . to_eye`.
fn outside(bounds: Bounds, to_eye: Vec3, aspect: f32) -> Viewpoint {
    let right = Vec3::Y.cross(to_eye).normalize_or_zero();
    let up = to_eye.cross(right);
    let spread = (FOV * 0.5).tan() / MARGIN;
    let needed = bounds.corners().map(|corner| {
        let across = (corner.dot(right) / aspect).abs().max(corner.dot(up).abs());
        corner.dot(to_eye) + across / spread
    });
    let distance = needed.into_iter().fold(0.0, f32::max);
    Viewpoint {
        eye: bounds.middle() + to_eye * distance,
        target: bounds.middle(),
        up: Vec3::Y,
        fov: FOV,
    }
}

/// From near an upper corner of a closed room, the one with the longest mean free view.
fn inside(polygons: &[Polygon], bounds: Bounds, aspect: f32) -> Viewpoint {
    let stands = STANDS.into_iter().flat_map(|(along, up)| {
        let corners = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
        corners.map(|(x, z)| Vec3::new(along * x, up, along * z))
    });
    let views = stands.map(|stand| Viewpoint {
        eye: bounds.middle() + bounds.half() * stand,
        target: bounds.middle(),
        up: Vec3::Y,
        fov: INDOOR_FOV,
    });
    let mut best = outside(bounds, Vec3::Z, aspect);
    let mut longest = 0.0;
    for view in views {
        let free = mean_free_view(polygons, bounds, view, aspect);
        if free > longest {
            (best, longest) = (view, free);
        }
    }
    best
}

/// Mean distance to what is seen in the picture; a ray that meets nothing counts as none.
fn mean_free_view(polygons: &[Polygon], bounds: Bounds, view: Viewpoint, aspect: f32) -> f32 {
    let forward = (view.target - view.eye).normalize_or_zero();
    let right = forward.cross(view.up).normalize_or_zero();
    let up = right.cross(forward);
    let reach = 4.0 * bounds.half().length();
    let spread = (view.fov * 0.5).tan();
    let distances = grid().map(|(x, y)| {
        let ray = forward + (right * (x * aspect) + up * y) * spread;
        let end = view.eye + ray.normalize_or_zero() * reach;
        let hits = polygons.iter().filter_map(|p| p.crossing(view.eye, end));
        hits.min_by(f32::total_cmp).map_or(0.0, |part| part * reach)
    });
    distances.sum::<f32>() / f32::from(GRID * GRID)
}
