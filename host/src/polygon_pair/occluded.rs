//! Occluded pairs: what a point sees, integrated over one of the polygons by adaptive subdivision.
//!
//! `A_1 F_12 = int_A1 F_xV dA`, in m2, with the visible part `V` of 2 as [`super::shadow`] cuts it, or the
//! same over 2. The integrand is smooth but for kinks. The strong ones lie on lines that are known: where
//! the plane of a blocker meets the domain, and where an edge of a blocker passes, in parallel, an
//! edge of the target or of another blocker. The domain is divided along those first. Then the cell
//! with the largest error is halved, across its rougher direction, until the sum of all
//! errors is small enough.
//!
//! Either the visible part is integrated, or the hidden one and subtracted from the open form factor,
//! whichever errs less: the hidden one knows nothing of singularities at shared edges that the blockers are
//! away from. A cell's error is the difference of the product Gauss rules with 3 x 3 and 4 x 4 points.
//!
//! # References
//! * P. S. Heckbert, *Discontinuity meshing for radiosity*, Eurographics Workshop on Rendering 1992: the
//!   lines along which irradiance has kinks.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use glam::DVec3;

use super::polygon::{Cell, bilinear, cells, clip, edges};
use super::rules::{GAUSS, Rule};
use super::shadow::{Blocker, View};
use super::{Estimate, Face};

/// Most cells: a few hundredths of a second.
const CELLS: usize = 4000;

/// Most parts that lines divide the domain into.
const PARTS: usize = 64;

/// Sines and distances (in units of the pair's size) below this are none.
const PARALLEL: f64 = 1e-9;

/// Visible shares of the open form factor below this are roundings: nothing is seen.
const NOTHING: f64 = 1e-12;

/// A cell may be so many times as wide as the smallest footprint in it.
const COARSEST: f64 = 3.0;

const COARSE: Rule = GAUSS[1];
const FINE: Rule = GAUSS[2];

/// `A_1 F_12` behind blockers, with its error, which is at most `tolerance` (relative) unless the bound on
/// the work forbids it.
///
/// `open` is the same without blockers; domain and target lie in front of each other.
pub(super) fn integrate(
    domain: &Face,
    target: &Face,
    blockers: &[Blocker],
    open: Estimate,
    tolerance: f64,
) -> Estimate {
    let mut view = View::new(domain.normal, &target.outline, blockers);
    let mut queue: Vec<Patch> = Vec::new();
    for part in divided(domain, target, blockers) {
        for cell in cells(&part) {
            resolve(cell, blockers, &mut |cell| {
                queue.push(Patch::new(cell, &mut view))
            });
        }
    }
    let mut sums = Sums::default();
    queue.iter().for_each(|patch| sums.add(patch, 1.0));
    let by_hidden = sums.hidden.error + open.error < sums.visible.error;
    queue.iter_mut().for_each(|patch| patch.rank(by_hidden));

    let mut queue = BinaryHeap::from(queue);
    let mut found = sums.result(open);
    while found.error > tolerance * found.value && queue.len() < CELLS {
        let Some(worst) = queue.pop() else { break };
        sums.add(&worst, -1.0);
        for half in halves(worst.cell, worst.is_rough_along_s) {
            let mut patch = Patch::new(half, &mut view);
            patch.rank(by_hidden);
            sums.add(&patch, 1.0);
            queue.push(patch);
        }
        found = sums.result(open);
    }
    found
}

/// Sums over the cells.
#[derive(Default)]
struct Sums {
    visible: Estimate,
    hidden: Estimate,
}

impl Sums {
    fn add(&mut self, patch: &Patch, sign: f64) {
        for (sum, part) in [
            (&mut self.visible, patch.visible),
            (&mut self.hidden, patch.hidden),
        ] {
            sum.value += sign * part.value;
            sum.error += sign * part.error;
        }
    }

    /// The better of the visible part and of what the hidden part leaves.
    fn result(&self, open: Estimate) -> Estimate {
        let rest = Estimate {
            value: open.value - self.hidden.value,
            error: self.hidden.error + open.error,
        };
        let better = if self.visible.error < rest.error {
            self.visible
        } else {
            rest
        };
        let nothing = NOTHING * open.value;
        let value = better.value.min(open.value);
        Estimate {
            value: if value > nothing { value } else { 0.0 },
            error: better.error.max(0.0) + nothing,
        }
    }
}

/// A cell of the domain with its share of the integrals.
struct Patch {
    cell: Cell,
    visible: Estimate,
    hidden: Estimate,
    is_rough_along_s: bool,
    /// The error that decides which cell is halved next.
    urgency: f64,
}

impl Patch {
    fn new(cell: Cell, view: &mut View) -> Self {
        let (fine, samples) = product(&cell, FINE, view);
        let (coarse, _) = product(&cell, COARSE, view);
        let [visible, hidden] = [0, 1].map(|k| Estimate {
            value: fine[k],
            error: (fine[k] - coarse[k]).abs(),
        });
        Self {
            cell,
            visible,
            hidden,
            is_rough_along_s: roughness(&samples, 4, 1) > roughness(&samples, 1, 4),
            urgency: 0.0,
        }
    }

    fn rank(&mut self, by_hidden: bool) {
        self.urgency = if by_hidden {
            self.hidden.error
        } else {
            self.visible.error
        };
    }
}

/// Integrals of the visible and the hidden form factor over a cell, and the visible one at the nodes.
fn product(cell: &Cell, rule: Rule, view: &mut View) -> ([f64; 2], [f64; 16]) {
    let (mut sums, mut samples) = ([0.0; 2], [0.0; 16]);
    for (i, (s, weight_s)) in rule.iter().enumerate() {
        for (j, (t, weight_t)) in rule.iter().enumerate() {
            let (x, density) = bilinear(cell, view.normal, *s, *t);
            let (whole, hidden) = view.whole_and_hidden(x);
            let weight = weight_s * weight_t * density;
            sums[0] += weight * (whole - hidden);
            sums[1] += weight * hidden;
            samples[rule.len() * i + j] = whole - hidden;
        }
    }
    (sums, samples)
}

/// The parts of second and third degree along a direction of the 4 x 4 samples.
///
/// `along` and `across` are the steps from one sample to the next; sums with the Gauss weights and
/// Legendre's polynomials, up to a common factor.
fn roughness(samples: &[f64; 16], along: usize, across: usize) -> f64 {
    (0..4)
        .map(|line| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| samples[line * across + k * along]);
            ((a + d) - (b + c)).abs() + ((d - a) / 2.532_6 - (c - b)).abs()
        })
        .sum()
}

impl PartialEq for Patch {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Patch {}

impl PartialOrd for Patch {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Patch {
    fn cmp(&self, other: &Self) -> Ordering {
        self.urgency.total_cmp(&other.urgency)
    }
}

/// A cell in two, across its first or its second parameter.
fn halves([a, b, c, d]: Cell, along_s: bool) -> [Cell; 2] {
    if along_s {
        let (ab, cd) = (a.midpoint(b), c.midpoint(d));
        [[a, ab, cd, d], [ab, b, c, cd]]
    } else {
        let (bc, ad) = (b.midpoint(c), a.midpoint(d));
        [[a, b, bc, ad], [ad, bc, c, d]]
    }
}

/// Halves a cell until no small footprint can slip through between its nodes.
fn resolve(cell: Cell, blockers: &[Blocker], found: &mut impl FnMut(Cell)) {
    let [a, b, c, d] = cell;
    let (width, height) = (
        a.distance(b).max(c.distance(d)),
        a.distance(d).max(b.distance(c)),
    );
    let is_coarse = blockers.iter().any(|blocker| {
        let first = blocker.footprint[0];
        let (low, high) = blocker
            .footprint
            .iter()
            .fold((first, first), |(low, high), v| (low.min(*v), high.max(*v)));
        let (cell_low, cell_high) = (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)));
        let is_apart = low.cmpgt(cell_high).any() || high.cmplt(cell_low).any();
        !is_apart && width.max(height) > COARSEST * low.distance(high)
    });
    if is_coarse {
        for half in halves(cell, width > height) {
            resolve(half, blockers, found);
        }
    } else {
        found(cell);
    }
}

/// The domain, divided along the lines of strong kinks.
fn divided(domain: &Face, target: &Face, blockers: &[Blocker]) -> Vec<Vec<DVec3>> {
    let mut parts = vec![domain.outline.clone()];
    for (point, normal) in kinks(target, blockers) {
        if parts.len() >= PARTS {
            break;
        }
        let split = |part: Vec<DVec3>| {
            let front = clip(&part, PARALLEL, |v| normal.dot(v - point));
            let back = clip(&part, PARALLEL, |v| -normal.dot(v - point));
            if front.is_empty() || back.is_empty() {
                vec![part]
            } else {
                vec![front, back]
            }
        };
        parts = parts.into_iter().flat_map(split).collect();
    }
    parts
}

/// Planes, as a point and a unit normal, beyond which the integrand continues with a strong kink.
fn kinks(target: &Face, blockers: &[Blocker]) -> Vec<(DVec3, DVec3)> {
    let own = blockers.iter().map(|b| (b.face.outline[0], b.face.normal));
    let mut planes: Vec<(DVec3, DVec3)> = own.collect();
    for (k, blocker) in blockers.iter().enumerate() {
        let others = blockers[..k].iter().map(|b| &b.face);
        for other in others.chain([target]) {
            planes.extend(parallels(&blocker.face.outline, &other.outline));
        }
    }
    planes
}

/// Planes through parallel edges of two outlines.
fn parallels(first: &[DVec3], second: &[DVec3]) -> Vec<(DVec3, DVec3)> {
    let mut planes = Vec::new();
    for (a, b) in edges(first) {
        let along = (b - a).normalize();
        for (c, d) in edges(second) {
            let normal = along.cross(c - a);
            let is_parallel = along.cross((d - c).normalize()).length() < PARALLEL;
            if is_parallel && normal.length() > PARALLEL {
                planes.push((a, normal.normalize()));
            }
        }
    }
    planes
}
