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
use super::polygon::{clip, edges, meet};
use super::shadow::Blocker;

/// Sines below this are those of parallel edges.
const PARALLEL: f64 = 1e-9;

/// Vertices that are lower than the light by less than this share of its height cast no shadow.
const LEVEL: f64 = 1e-6;

/// Most other blockers that one is paired with, which bounds the work behind hundreds of them.
const PARTNERS: usize = 12;

/// Where an event shows on the domain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Event {
    pub(super) from: DVec3,
    pub(super) to: DVec3,
    /// Whether the form factor has a kink there, not only its slope.
    pub(super) is_strong: bool,
}

/// The events of all blockers with the target and with each other.
pub(super) fn events(domain: &Face, target: &Face, blockers: &[Blocker]) -> Vec<Event> {
    let mut events = Vec::new();
    for (k, blocker) in blockers.iter().enumerate() {
        events.extend(own_plane(domain, &blocker.face));
        pass(domain, &target.outline, &blocker.face.outline, &mut events);
        let others = blockers[..k].iter();
        let others = others.filter(|other| meet(other.footprint_bounds, blocker.footprint_bounds));
        for other in others.take(PARTNERS) {
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
    let in_line = |v: DVec3, w: DVec3| {
        let (height_v, height_w) = (domain.height(v), domain.height(w));
        v + (w - v) * (height_v / (height_v - height_w))
    };
    for (v, partners) in corners(high) {
        let height = domain.height(v) * (1.0 - LEVEL);
        let casting = clip(low, 0.0, |w| height - domain.height(w));
        images(&casting, partners, |w| in_line(v, w), events);
    }
    for (w, partners) in corners(low) {
        let height = domain.height(w) * (1.0 + LEVEL);
        let shining = clip(high, 0.0, |v| domain.height(v) - height);
        images(&shining, partners, |v| in_line(v, w), events);
    }
}

/// The vertices of an outline with the directions of the edges that meet there.
fn corners(outline: &[DVec3]) -> impl Iterator<Item = (DVec3, [DVec3; 2])> + '_ {
    let last = outline.iter().cycle().skip(outline.len().saturating_sub(1));
    let directions = |(before, (v, next)): (&DVec3, (DVec3, DVec3))| {
        (v, [v - *before, next - v].map(DVec3::normalize_or_zero))
    };
    last.zip(edges(outline)).map(directions)
}

/// The events that the edges of an outline make with one corner; those parallel to an edge there are strong.
fn images(
    outline: &[DVec3],
    partners: [DVec3; 2],
    image: impl Fn(DVec3) -> DVec3,
    events: &mut Vec<Event>,
) {
    events.extend(edges(outline).map(|(a, b)| {
        let along = (b - a).normalize_or_zero();
        let is_parallel = |partner: &DVec3| partner.cross(along).length() < PARALLEL;
        Event {
            from: image(a),
            to: image(b),
            is_strong: partners.iter().any(is_parallel),
        }
    }));
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

#[cfg(test)]
mod tests {
    use super::*;

    fn square(z: f64, half: f64) -> Face {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        Face {
            outline: corners
                .map(|(u, v)| DVec3::new(u * half, v * half, z))
                .to_vec(),
            normal: DVec3::Z,
        }
    }

    #[test]
    fn a_plate_midway_makes_strong_events_where_parallel_edges_align() {
        let (domain, target) = (square(0.0, 1.0), square(1.0, 1.0));
        let blocker = Blocker::new(square(0.5, 0.25), &domain, &target, 1e-14).unwrap();
        let events = events(&domain, &target, &[blocker]);
        // Lines at 2 (+-0.25) - (+-1): +-0.5 inside the domain, +-1.5 outside.
        let inside: Vec<&Event> = events
            .iter()
            .filter(|e| e.crosses(&domain.outline, domain.normal, 1e-9))
            .collect();
        assert!(!inside.is_empty());
        for event in inside {
            assert!(event.is_strong, "{event:?}");
            let is_on = |c: fn(DVec3) -> f64| {
                (c(event.from).abs() - 0.5).abs() < 1e-12
                    && (c(event.to) - c(event.from)).abs() < 1e-12
            };
            assert!(is_on(|v| v.x) || is_on(|v| v.y), "{event:?}");
        }
    }

    #[test]
    fn an_event_parts_an_outline_that_it_crosses() {
        let domain = square(0.0, 1.0);
        let event = Event {
            from: DVec3::new(0.25, -3.0, 0.0),
            to: DVec3::new(0.25, 0.0, 0.0),
            is_strong: true,
        };
        assert!(event.crosses(&domain.outline, domain.normal, 1e-9));
        let parts = event.split(&domain.outline, domain.normal, 1e-9);
        let areas = parts.map(|part| super::super::vector_area(&part).length());
        assert!((areas[0] + areas[1] - 4.0).abs() < 1e-14, "{areas:?}");
        let beside = Event {
            from: event.from + DVec3::X,
            to: event.to + DVec3::X,
            ..event
        };
        assert!(!beside.crosses(&domain.outline, domain.normal, 1e-9));
    }
}
