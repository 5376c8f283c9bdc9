//! A shooter as the points of a receiver see it.
//!
//! Points of one receiver share its plane, so what lies above the horizon, what may stand between and
//! which part of that stands before the shooter are found once for all of them.

use glam::Vec3;
use heapless::Vec;

use super::lambert::{Outline, lambert};
use super::lanes::{Mask, Numbers, Vectors};
use super::visible::{Blocker, Hides, Points, hides, visible_factors};
use super::{BLOCKERS, Shooter};
use crate::geometry::{Plane, Polygon, SamplePoint, as_many, clip, gauss_points};
use crate::visibility::{Body, Obstacle, Shaft, Visibility};

/// An element with the points that stand for it.
#[derive(Clone, Debug)]
pub struct Receiver {
    polygon: Polygon,
    points: Vectors,
    /// Largest coordinate of each point.
    magnitude: Numbers,
    /// Share of the area for which each point stands; the fourth of a triangle stands for nothing.
    weights: [f32; 4],
}

impl Receiver {
    /// Places the Gauss points.
    #[must_use]
    pub fn new(polygon: Polygon) -> Self {
        let points = gauss_points(&polygon);
        let point = |index| points.get(index).copied();
        let of = [point(0), point(1), point(2), point(3)];
        let position =
            |point: Option<SamplePoint>| point.map_or_else(|| polygon.center(), |p| p.position);
        let points = Vectors::new(of.map(position));
        Self {
            polygon,
            points,
            magnitude: points.magnitude(),
            weights: of.map(|point| point.map_or(0.0, |p| p.weight)),
        }
    }

    /// Its outline.
    #[must_use]
    pub const fn polygon(&self) -> &Polygon {
        &self.polygon
    }

    /// Its points.
    pub(super) fn positions(&self) -> [Vec3; 4] {
        self.points.lanes()
    }

    /// The average over its area of what its points see, in [0, 1].
    pub(super) fn average(&self, factors: Numbers) -> f32 {
        let Numbers([a, b, c, d]) = factors * Numbers(self.weights);
        (a + b + c + d).min(1.0)
    }
}

/// What a receiver, or a patch that holds it, sees of a shooter and of what stands between.
#[derive(Clone, Debug)]
pub struct View<'s> {
    shooter: &'s Shooter,
    normal: Vec3,
    /// What outlines are relative to: there coordinates are small.
    origin: Vec3,
    /// The shooter above the receiver's horizon; empty where they do not face each other.
    outline: Vec<Vec3, 6>,
    blockers: Vec<Blocker<'s>, BLOCKERS>,
    /// False for more blockers than can be cut out.
    is_exact: bool,
}

impl<'s> View<'s> {
    pub(super) fn new(
        shooter: &'s Shooter,
        receiver: &Polygon,
        visibility: &'s impl Visibility,
    ) -> Self {
        if shooter.is_out_of_sight(receiver) {
            return Self::nothing(shooter, receiver.plane());
        }
        let shaft = || Shaft::new(receiver, &shooter.polygon);
        Self::of_plane(
            shooter,
            receiver.plane(),
            receiver.vertices(),
            visibility,
            shaft,
        )
    }

    pub(super) fn of_point(
        shooter: &'s Shooter,
        point: Vec3,
        normal: Vec3,
        visibility: &'s impl Visibility,
    ) -> Self {
        let plane = Plane {
            origin: point,
            normal,
            flatness: 0.0,
        };
        let (height, tolerance) = shooter.polygon.height(point);
        if height <= tolerance {
            return Self::nothing(shooter, plane);
        }
        let shaft = || Shaft::from_point(point, normal, &shooter.polygon);
        Self::of_plane(shooter, plane, &[point], visibility, shaft)
    }

    fn nothing(shooter: &'s Shooter, plane: Plane) -> Self {
        Self {
            shooter,
            normal: plane.normal,
            origin: plane.origin,
            outline: Vec::new(),
            blockers: Vec::new(),
            is_exact: true,
        }
    }

    fn of_plane(
        shooter: &'s Shooter,
        plane: Plane,
        corners: &[Vec3],
        visibility: &'s impl Visibility,
        shaft: impl FnOnce() -> Shaft,
    ) -> Self {
        let Plane { origin, normal, .. } = plane;
        let vertices = shooter.polygon.vertices().iter();
        let relative: Vec<Vec3, 4> = as_many(vertices.map(|v| *v - origin));
        let above = clip(&relative, |v| v.dot(normal));
        let mut view = Self {
            shooter,
            normal,
            origin,
            outline: as_many(above.iter().copied()),
            blockers: Vec::new(),
            is_exact: true,
        };
        if visibility.may_block() && !above.is_empty() {
            let corner = |index| corners.get(index).or(corners.first()).copied();
            let of = [0, 1, 2, 3].map(|index| corner(index).unwrap_or(origin));
            let world = Vectors::new(of);
            let points = view.points(world, world.magnitude());
            let mut whole: Option<&Body> = None;
            let mut is_hidden = false;
            visibility.between(&shaft(), &mut |Obstacle { polygon, body }| {
                let is_same = |body: &Body| whole.is_some_and(|whole| core::ptr::eq(whole, body));
                if body.is_some_and(is_same) {
                    return;
                }
                let together = body.and_then(|b| Blocker::body(&shooter.polygon, b, corners));
                if together.is_some() {
                    whole = body;
                }
                let alone = || Blocker::face(&shooter.polygon, polygon, origin);
                let Some(blocker) = together.or_else(alone) else {
                    return;
                };
                match hides(&blocker, &points, &view.outline) {
                    Hides::Nothing => {}
                    Hides::Something => view.is_exact &= view.blockers.push(blocker).is_ok(),
                    Hides::Everything => is_hidden = true,
                }
            });
            if is_hidden {
                view.outline.clear();
            }
        }
        for cover in &shooter.covers {
            view.is_exact &= view.blockers.push(Blocker::cover(cover, origin)).is_ok();
        }
        view
    }

    /// Who shoots.
    #[must_use]
    pub const fn shooter(&self) -> &'s Shooter {
        self.shooter
    }

    /// False where more stands before the receiver than can be cut out for all of it at once.
    #[must_use]
    pub const fn is_exact(&self) -> bool {
        self.is_exact
    }

    /// True where nothing of the shooter can be seen from anywhere on the receiver.
    #[must_use]
    pub fn is_hidden(&self) -> bool {
        self.outline.is_empty()
    }

    /// True where nothing stands between.
    pub(super) fn is_open(&self) -> bool {
        self.is_exact && self.blockers.is_empty()
    }

    pub(super) const fn normal(&self) -> Vec3 {
        self.normal
    }

    /// `F_ji` of the receiver, or of a part of it: what its points see of the shooter, averaged over its
    /// area. In [0, 1].
    #[must_use]
    pub fn form_factor(&self, receiver: &Receiver, visibility: &impl Visibility) -> f32 {
        if self.is_hidden() {
            return 0.0;
        }
        if !self.is_exact {
            // What is too much for a patch may not be for a part of it.
            let narrow = View::new(self.shooter, &receiver.polygon, visibility);
            if narrow.is_exact {
                return narrow.form_factor(receiver, visibility);
            }
        }
        let points = self.points(receiver.points, receiver.magnitude);
        let factors = self.exact(&points).unwrap_or_else(|| {
            let samples = receiver.positions().into_iter().zip(&self.shooter.samples);
            let mut factors = [0.0; 4];
            for (factor, (point, samples)) in factors.iter_mut().zip(samples) {
                *factor = self.sampled(point, samples, visibility);
            }
            Numbers(factors)
        });
        receiver.average(factors)
    }

    /// What the points of a receiver would see if nothing stood between.
    pub(super) fn open_factors(&self, receiver: &Receiver) -> Numbers {
        let points = self.points(receiver.points, receiver.magnitude);
        let facing = self.facing(&points);
        let factors = self.open(&points).within(facing);
        factors.map(|factor| factor.max(0.0))
    }

    /// The points that are before the shooter.
    fn facing(&self, points: &Points) -> Mask {
        let (height, tolerance) = points.height(&self.shooter.polygon.plane());
        height.above(tolerance)
    }

    fn points(&self, world: Vectors, magnitude: Numbers) -> Points {
        Points {
            world,
            relative: world - Vectors::all(self.origin),
            magnitude,
        }
    }

    fn point(&self, point: Vec3) -> Points {
        let world = Vectors::all(point);
        self.points(world, world.magnitude())
    }

    /// The factors of what is visible; `None` when the blockers are too many to be cut out.
    fn exact(&self, points: &Points) -> Option<Numbers> {
        let facing = self.facing(points);
        if facing == 0 {
            return Some(Numbers::ZERO);
        }
        let factors = if self.is_open() {
            self.open(points)
        } else if self.is_exact {
            visible_factors(points, self.normal, &self.outline, &self.blockers)?
        } else {
            return None;
        };
        Some(factors.within(facing).map(|factor| factor.max(0.0)))
    }

    fn open(&self, points: &Points) -> Numbers {
        let seen = self.outline.iter();
        let seen: Outline = as_many(seen.map(|v| Vectors::all(*v) - points.relative));
        lambert(self.normal, &seen)
    }

    /// What the point that the view was made for sees.
    pub(super) fn exact_at_point(&self, point: Vec3) -> Option<f32> {
        if self.outline.is_empty() {
            return Some(0.0);
        }
        let Numbers([factor, ..]) = self.exact(&self.point(point))?;
        Some(factor.min(1.0))
    }

    /// The same; sampled where blockers are too many to be cut out.
    pub(super) fn at_point(&self, point: Vec3, visibility: &impl Visibility) -> f32 {
        self.exact_at_point(point).unwrap_or_else(|| {
            let samples = self.shooter.samples.iter().flatten().copied();
            let samples: Vec<SamplePoint, 16> = as_many(samples);
            self.sampled(point, &samples, visibility).min(1.0)
        })
    }

    /// Lambert's factor times the visible share of the kernel at some points of the patch.
    fn sampled(&self, point: Vec3, samples: &[SamplePoint], visibility: &impl Visibility) -> f32 {
        let (height, tolerance) = self.shooter.polygon.height(point);
        let Numbers([open, ..]) = self.open(&self.point(point));
        if height <= tolerance || open <= 0.0 {
            return 0.0;
        }
        let visible = self.visible_share(point, samples, visibility);
        open * visible.unwrap_or_else(|| self.sees_middle(point, visibility))
    }

    /// Share of the kernel that is not hidden; `None` when every sample is below the horizon.
    fn visible_share(
        &self,
        point: Vec3,
        samples: &[SamplePoint],
        visibility: &impl Visibility,
    ) -> Option<f32> {
        let (mut seen, mut total) = (0.0, 0.0);
        for sample in samples {
            let ray = sample.position - point;
            let square = ray.length_squared();
            let cosines = ray.dot(self.normal) * -ray.dot(self.shooter.polygon.normal());
            if cosines <= 0.0 || square <= f32::MIN_POSITIVE {
                continue;
            }
            let kernel = sample.weight * cosines / (square * square);
            total += kernel;
            if !self.shooter.is_covered(sample.position) && visibility.sees(point, sample.position)
            {
                seen += kernel;
            }
        }
        (total > 0.0 && total.is_finite()).then(|| (seen / total).min(1.0))
    }

    /// 1 when the middle of what is above the horizon is visible, else 0.
    fn sees_middle(&self, point: Vec3, visibility: &impl Visibility) -> f32 {
        let sum: Vec3 = self.outline.iter().copied().sum();
        let middle = self.origin + sum / self.outline.len().max(1) as f32;
        f32::from(u8::from(visibility.sees(point, middle)))
    }
}
