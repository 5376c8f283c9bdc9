//! Lines on a domain along which the view of a target behind blockers changes its shape.
//!
//! From a point of the domain, a vertex of the target passes behind an edge of a blocker, or an edge of the target
//! behind a vertex of it, when the two are in line. These places are the edges of the shadow that the blocker
//! casts when a vertex `v` of the target is the light, and of the image that a pinhole at a vertex `w` of the blocker
//! makes of the target: with heights `h` above the domain, `v` and `w` are in line from
//!
//! `P(v, w) = v + (w - v) h_v / (h_v - h_w)`, for `h_v > h_w`.
//!
//! Between blockers the same happens with the higher one as the target. What three edges of different
//! polygons do together lies on curves, which are not here. Across an event the form factor is smooth to first order,
//! except where parallel edges pass each other: those events are strong.
//!
//! # References
//! * P. S. Heckbert, *Discontinuity meshing for radiosity*, Eurographics Workshop on Rendering 1992.

use glam::DVec3;

use super::Face;
use super::polygon::{clip, edges};
use super::shadow::Blocker;

/// Sines below this are those of parallel edges.
const PARALLEL: f64 = 1e-9;

/// Vertices that are lower than the light by less than this share of its height cast no shadow.
const LEVEL: f64 = 1e-6;

/// Where an event shows on the domain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Event {
    pub(super) from: DVec3,
    pub(super) to: DVec3,
    /// Whether the form factor has a kink there, not only its slope.
    pub(super) is_strong: bool,
}

/// All events of single blockers and of pairs of them.
pub(super) fn events(domain: &Face, target: &Face, blockers: &[Blocker]) -> Vec<Event> {
    let mut events = Vec::new();
    for (k, blocker) in blockers.iter().enumerate() {
        events.extend(own_plane(domain, &blocker.face));
        pass(domain, &target.outline, &blocker.face.outline, &mut events);
        for other in &blockers[..k] {
            pass(
                domain,
                &other.face.outline,
                &blocker.face.outline,
                &mut events,
            );
            pass(
                domain,
                &blocker.face.outline,
                &other.face.outline,
                &mut events,
            );
        }
    }
    events
}

/// Where the plane of a blocker cuts the domain: beyond it the other side is in the way.
fn own_plane(domain: &Face, blocker: &Face) -> Option<Event> {
    let mut ends = edges(&domain.outline).filter_map(|(a, b)| {
        let (height_a, height_b) = (blocker.height(a), blocker.height(b));
        let crosses = (height_a > 0.0) != (height_b > 0.0);
        crosses.then(|| a + (b - a) * (height_a / (height_a - height_b)))
    });
    Some(Event {
        from: ends.next()?,
        to: ends.next()?,
        is_strong: true,
    })
}

/// The events of a lower outline passing before a higher one.
fn pass(domain: &Face, high: &[DVec3], low: &[DVec3], events: &mut Vec<Event>) {
    let project = |v: DVec3, w: DVec3| {
        let (height_v, height_w) = (domain.height(v), domain.height(w));
        v + (w - v) * (height_v / (height_v - height_w))
    };
    let directions = |outline: &[DVec3]| -> Vec<DVec3> {
        edges(outline)
            .map(|(a, b)| (b - a).normalize_or_zero())
            .collect()
    };
    let is_parallel = |a: DVec3, b: DVec3| a.cross(b).length() < PARALLEL;
    let mut push = |light: DVec3,
                    image: &mut dyn FnMut(DVec3) -> DVec3,
                    outline: &[DVec3],
                    partners: &[DVec3]| {
        let _ = light;
        for (a, b) in edges(outline) {
            let along = (b - a).normalize_or_zero();
            events.push(Event {
                from: image(a),
                to: image(b),
                is_strong: partners.iter().any(|p| is_parallel(*p, along)),
            });
        }
    };
    let (high_directions, low_directions) = (directions(high), directions(low));
    for (k, v) in high.iter().enumerate() {
        let height = domain.height(*v);
        let shown = clip(low, LEVEL * height, |w| {
            height - domain.height(w) - 2.0 * LEVEL * height
        });
        let before = (k + high.len() - 1) % high.len();
        let partners = [high_directions[k], high_directions[before]];
        push(*v, &mut |w| project(*v, w), &shown, &partners);
    }
    for (k, w) in low.iter().enumerate() {
        let height = domain.height(*w);
        let shown = clip(high, LEVEL * height, |v| {
            domain.height(v) - height - 2.0 * LEVEL * height
        });
        let before = (k + low.len() - 1) % low.len();
        let partners = [low_directions[k], low_directions[before]];
        push(*w, &mut |v| project(v, *w), &shown, &partners);
    }
}

impl Event {
    /// True when the event shows inside a convex outline, deeper than `grain` within its border.
    pub(super) fn crosses(&self, outline: &[DVec3], normal: DVec3, grain: f64) -> bool {
        let along = self.to - self.from;
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for (a, b) in edges(outline) {
            let inward = normal.cross(b - a).normalize_or_zero();
            if inward == DVec3::ZERO {
                continue;
            }
            let depth = inward.dot(self.from - a) - grain;
            let slope = inward.dot(along);
            if slope > 0.0 {
                enter = enter.max(-depth / slope);
            } else if slope < 0.0 {
                leave = leave.min(-depth / slope);
            } else if depth < 0.0 {
                return false;
            }
        }
        (leave - enter) * along.length() > grain
    }

    /// The two sides of a convex outline.
    pub(super) fn split(&self, outline: &[DVec3], normal: DVec3, grain: f64) -> [Vec<DVec3>; 2] {
        let across = normal.cross(self.to - self.from).normalize_or_zero();
        [across, -across].map(|across| clip(outline, grain, |v| across.dot(v - self.from)))
    }
}
