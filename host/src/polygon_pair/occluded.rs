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

use super::events::{Event, events};
use super::polygon::{Bounds, Cell, ROUNDINGS, bilinear, bounds, cells, diagonal, gap, meet};
use super::rules::{GAUSS, Rule};
use super::shadow::{Blocker, View};
use super::{Estimate, Face};

/// Most cells: a few hundredths of a second.
const CELLS: usize = 4000;

/// Lengths below this share of the domain's radius are none.
const GRAIN: f64 = 1e-10;

/// Visible shares of the open form factor below this are roundings: nothing is seen.
const NOTHING: f64 = 1e-12;

/// A cell may be so many times as wide as the smallest footprint in it.
const COARSEST: f64 = 3.0;

/// A cell may be so many times as long as wide, unless blockers and target are farther than its length.
const SLENDER: f64 = 4.0;

/// Most halvings on account of the two.
const HALVINGS: usize = 10;

/// Error of a cell with an event inside, in units of its second and third Legendre coefficients.
const CROSSED: f64 = 0.05;

/// The same in units of the open form factor: events may bound a shadow or an opening that all nodes miss.
const BLIND: f64 = 1e-3;

/// The same in units of the third, for cells where curved events of several blockers may hide.
const SHARED: f64 = 0.001;

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
    let mesh = Mesh::new(domain, target, blockers);
    let mut view = View::new(domain.normal, &target.outline, blockers);
    let mut queue: Vec<Patch> = Vec::new();
    let all: Vec<usize> = (0..mesh.events.len()).collect();
    mesh.divide(&domain.outline, &all, &mut |cell, events| {
        mesh.resolve(cell, events, HALVINGS, &mut |cell, events| {
            queue.push(Patch::new(cell, events, &mesh, &mut view))
        });
    });
    let mut sums = Sums::default();
    queue.iter().for_each(|patch| sums.add(patch, 1.0));
    let by_hidden = sums.hidden.error + open.error < sums.visible.error;
    queue.iter_mut().for_each(|patch| patch.rank(by_hidden));

    let mut queue = BinaryHeap::from(queue);
    let mut found = sums.result(open);
    let mut evaluated = queue.len();
    while found.error > tolerance * found.value && evaluated < CELLS {
        let Some(worst) = queue.pop() else { break };
        sums.add(&worst, -1.0);
        for mut patch in worst.refined(&mesh, &mut view) {
            patch.rank(by_hidden);
            sums.add(&patch, 1.0);
            queue.push(patch);
            evaluated += 1;
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
    /// Events that show inside.
    events: Vec<usize>,
    visible: Estimate,
    hidden: Estimate,
    is_rough_along_s: bool,
    /// The error that decides which cell is halved next.
    urgency: f64,
}

impl Patch {
    fn new(cell: Cell, events: Vec<usize>, mesh: &Mesh, view: &mut View) -> Self {
        let (fine, samples) = product(&cell, FINE, view);
        let (coarse, _) = product(&cell, COARSE, view);
        let rough = [roughness(&samples, 4, 1), roughness(&samples, 1, 4)];
        let second = rough[0].0 + rough[1].0;
        let third = rough[0].1 + rough[1].1;
        let extra = if !events.is_empty() {
            CROSSED * (second + third) + BLIND * (fine[0] + fine[1])
        } else if mesh.is_doubtful(&cell) {
            SHARED * third
        } else {
            0.0
        };
        let [visible, hidden] = [0, 1].map(|k| Estimate {
            value: fine[k],
            error: (fine[k] - coarse[k]).abs() + extra,
        });
        Self {
            cell,
            events,
            visible,
            hidden,
            is_rough_along_s: rough[0].0 + rough[0].1 > rough[1].0 + rough[1].1,
            urgency: 0.0,
        }
    }

    /// The cell in parts: along an event inside, or halved.
    fn refined(self, mesh: &Mesh, view: &mut View) -> Vec<Patch> {
        let mut parts = Vec::with_capacity(2);
        mesh.refine(
            self.cell,
            &self.events,
            self.is_rough_along_s,
            &mut |cell, events| {
                parts.push(Patch::new(cell, events, mesh, view));
            },
        );
        parts
    }

    fn rank(&mut self, by_hidden: bool) {
        self.urgency = if by_hidden {
            self.hidden.error
        } else {
            self.visible.error
        };
    }
}

/// Integrals of the visible and the hidden form factor over a cell, and the visible one's samples.
fn product(cell: &Cell, rule: Rule, view: &mut View) -> ([f64; 2], [f64; 16]) {
    let (mut sums, mut samples) = ([0.0; 2], [0.0; 16]);
    for (i, (s, weight_s)) in rule.iter().enumerate() {
        for (j, (t, weight_t)) in rule.iter().enumerate() {
            let (x, density) = bilinear(cell, view.normal, *s, *t);
            let (whole, hidden) = view.whole_and_hidden(x);
            let weight = weight_s * weight_t * density;
            sums[0] += weight * (whole - hidden);
            sums[1] += weight * hidden;
            samples[rule.len() * i + j] = hidden * density;
        }
    }
    (sums, samples)
}

/// Mean absolute coefficients of Legendre's second and third polynomial along a direction of the 4 x 4 samples.
///
/// `along` and `across` are the steps from one sample to the next; sums with the Gauss weights.
fn roughness(samples: &[f64; 16], along: usize, across: usize) -> (f64, f64) {
    let mut sums = (0.0, 0.0);
    for line in 0..4 {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| samples[line * across + k * along]);
        sums.0 += 0.532_5 * ((a + d) - (b + c)).abs() / 4.0;
        sums.1 += 0.371_1 * ((d - a) - 2.532_6 * (c - b)).abs() / 4.0;
    }
    sums
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

/// What cells are divided by.
struct Mesh<'a> {
    normal: DVec3,
    events: Vec<Event>,
    blockers: &'a [Blocker],
    target_bounds: Bounds,
    grain: f64,
}

impl<'a> Mesh<'a> {
    fn new(domain: &Face, target: &Face, blockers: &'a [Blocker]) -> Self {
        Self {
            normal: domain.normal,
            events: events(domain, target, blockers),
            blockers,
            target_bounds: bounds(&target.outline),
            grain: GRAIN * domain.radius() + ROUNDINGS,
        }
    }

    /// Hands out the cells of an outline that is divided along all strong events.
    fn divide(
        &self,
        outline: &[DVec3],
        events: &[usize],
        found: &mut impl FnMut(Cell, Vec<usize>),
    ) {
        let crossing = self.crossing(outline, events);
        let mut strong = crossing.iter().filter(|k| self.events[**k].is_strong);
        match strong.find_map(|k| self.split(outline, *k)) {
            Some((parts, by)) => {
                let rest: Vec<usize> = crossing.into_iter().filter(|k| *k != by).collect();
                for part in &parts {
                    self.divide(part, &rest, found);
                }
            }
            None => self.cut(outline, &crossing, found),
        }
    }

    /// Hands out the parts of a cell: along an event inside, or halves.
    fn refine(
        &self,
        cell: Cell,
        events: &[usize],
        along_s: bool,
        found: &mut impl FnMut(Cell, Vec<usize>),
    ) {
        match events.iter().find_map(|k| self.split(&cell, *k)) {
            Some((parts, by)) => {
                let rest: Vec<usize> = events.iter().copied().filter(|k| *k != by).collect();
                parts.iter().for_each(|part| self.cut(part, &rest, found));
            }
            None => {
                for half in halves(cell, along_s) {
                    // Events that cannot be split off lie along the border.
                    found(half, Vec::new());
                }
            }
        }
    }

    /// The two sides of an event, with its number; `None` where it leaves the outline whole.
    fn split(&self, outline: &[DVec3], by: usize) -> Option<([Vec<DVec3>; 2], usize)> {
        let parts = self.events[by].split(outline, self.normal, self.grain);
        let is_split = parts.iter().all(|part| !part.is_empty());
        is_split.then_some((parts, by))
    }

    /// Hands out the cells of an outline.
    fn cut(&self, outline: &[DVec3], events: &[usize], found: &mut impl FnMut(Cell, Vec<usize>)) {
        for cell in cells(outline) {
            found(cell, self.crossing(&cell, events));
        }
    }

    /// Those of some events that show inside an outline.
    fn crossing(&self, outline: &[DVec3], events: &[usize]) -> Vec<usize> {
        let crosses = |k: &usize| self.events[*k].crosses(outline, self.normal, self.grain);
        events.iter().copied().filter(crosses).collect()
    }

    /// Halves a cell until no small footprint and no layer along a near edge can slip through its nodes.
    fn resolve(
        &self,
        cell: Cell,
        events: Vec<usize>,
        depth: usize,
        found: &mut impl FnMut(Cell, Vec<usize>),
    ) {
        let [a, b, c, d] = cell;
        let (width, height) = (
            a.distance(b).max(c.distance(d)),
            a.distance(d).max(b.distance(c)),
        );
        let (long, short) = (width.max(height), width.min(height));
        let extent = bounds(&cell);
        let is_coarse = self.blockers.iter().any(|blocker| {
            meet(extent, blocker.footprint_bounds)
                && long > COARSEST * diagonal(blocker.footprint_bounds)
        });
        let is_slender = long > SLENDER * short && {
            let near = |other: Bounds| gap(extent, other) < long;
            near(self.target_bounds) && self.blockers.iter().any(|b| near(b.bounds))
        };
        if depth > 0 && (is_coarse || is_slender) {
            for half in halves(cell, width > height) {
                let events = self.crossing(&half, &events);
                self.resolve(half, events, depth - 1, found);
            }
        } else {
            found(cell, events);
        }
    }

    /// True where layers along near edges or curved events of several blockers may hide in a cell.
    fn is_doubtful(&self, cell: &Cell) -> bool {
        let cell = bounds(cell);
        let acting = self
            .blockers
            .iter()
            .filter(|b| meet(cell, b.footprint_bounds));
        let near = |other: Bounds| gap(cell, other) < diagonal(cell);
        acting.clone().count() > 1
            || near(self.target_bounds) && acting.clone().any(|b| near(b.bounds))
    }
}
