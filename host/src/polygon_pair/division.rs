//! Cells of a domain: along events, and as fine as layers and small shadows need.
//!
//! A cell is a bilinear quad that knows the events inside it. Before anything is evaluated the domain is divided
//! along its strong events, then cells are halved where something narrower than a cell may lie:
//! the footprint of a small blocker, the ends of an edge that is near, the foot of a blocker between close polygons.

use glam::DVec3;

use super::Face;
use super::events::{Event, events};
use super::polygon::{Bounds, Cell, ROUNDINGS, bounds, cells, diagonal, gap, meet};
use super::shadow::Blocker;

/// Lengths below this share of the domain's radius are none.
const GRAIN: f64 = 1e-10;

/// Most parts that strong events divide the domain into.
const PARTS: usize = 500;

/// A cell may be so many times as wide as the smallest footprint in it.
const COARSEST: f64 = 3.0;

/// A cell near target and blockers may be so many times as long as wide: the ends of a near edge show there.
const SLENDER: f64 = 4.0;

/// A cell may be so many times as long as target and blockers are far: a layer of that width lies at
/// the foot of a blocker.
const LAYER: f64 = 8.0;

/// Most halvings of a cell for layers.
const LAYER_HALVINGS: usize = 8;

/// Most halvings of a cell before it is evaluated.
const HALVINGS: usize = 10;

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
#[derive(Debug)]
pub(super) struct Division<'a> {
    normal: DVec3,
    events: Vec<Event>,
    blockers: &'a [Blocker],
    target_bounds: Bounds,
    grain: f64,
}

impl<'a> Division<'a> {
    pub(super) fn new(domain: &Face, target: &Face, blockers: &'a [Blocker]) -> Self {
        Self {
            normal: domain.normal,
            events: events(domain, target, blockers),
            blockers,
            target_bounds: bounds(&target.outline),
            grain: GRAIN * domain.radius() + ROUNDINGS,
        }
    }

    /// Hands out the first cells of the domain, with the numbers of the events inside.
    pub(super) fn start(&self, domain: &Face, mut found: impl FnMut(Cell, Vec<usize>)) {
        let all: Vec<usize> = (0..self.events.len()).collect();
        let mut waiting = vec![(domain.outline.clone(), all)];
        let mut parts = 1;
        while let Some((outline, events)) = waiting.pop() {
            let mut crossing = self.crossing(&outline, &events);
            let mut strong = crossing.iter().filter(|k| self.events[**k].is_strong);
            let split = strong.find_map(|k| self.split(&outline, *k));
            match split.filter(|_| parts < PARTS) {
                Some((halves, by)) => {
                    parts += 1;
                    crossing.retain(|k| *k != by);
                    waiting.extend(halves.map(|half| (half, crossing.clone())));
                }
                None => self.cut(&outline, &crossing, &mut |cell, events| {
                    self.resolve(cell, events, HALVINGS, &mut found);
                }),
            }
        }
    }

    /// Hands out the parts of a cell: along an event inside, or halves.
    pub(super) fn refine(
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
        let to_target = gap(extent, self.target_bounds);
        let to_blocker = self.blockers.iter().map(|b| gap(extent, b.bounds));
        let to_blocker = to_blocker.fold(f64::INFINITY, f64::min);
        let is_slender = long > SLENDER * short && to_target.max(to_blocker) < long;
        let is_layered =
            long > LAYER * to_target.max(to_blocker) && depth > HALVINGS - LAYER_HALVINGS;
        if depth > 0 && (is_coarse || is_slender || is_layered) {
            for half in halves(cell, width > height) {
                let events = self.crossing(&half, &events);
                self.resolve(half, events, depth - 1, found);
            }
        } else {
            found(cell, events);
        }
    }

    /// True where layers along near edges or curved events of several blockers may hide in a cell.
    pub(super) fn is_doubtful(&self, cell: &Cell) -> bool {
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
