//! Occluded pairs: what a point sees, integrated over one of the polygons by adaptive subdivision.
//!
//! `A_1 F_12 = int_A1 F_xV dA`, in m2, with the visible part `V` of 2 as [`super::shadow`] cuts it, or the
//! same over 2. The integrand is smooth but for [`super::events`], which lie on known lines, and
//! layers beside edges and blockers that are close to both polygons. The domain is divided along the
//! strong events, and finer where layers can be. Then the cell with the largest error is parted along an
//! event inside it, or halved across its rougher direction, until the sum of all errors is small enough.
//!
//! Either the visible part is integrated, or the hidden one and subtracted from the open form factor,
//! whichever errs less: the hidden one knows nothing of singularities at shared edges that the blockers are
//! away from. A cell's error is the difference of the product Gauss rules with 3 x 3 and 4 x 4 points, and a
//! doubt where the rules may agree by chance.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::division::Division;
use super::polygon::{Cell, bilinear};
use super::rules::{GAUSS, Rule};
use super::shadow::{Blocker, View};
use super::{Estimate, Face};

/// Most cells, and most cells times blockers: some tenths of a second.
const CELLS: usize = 4000;
const CELLS_TIMES_BLOCKERS: usize = 40_000;

/// Visible shares of the open form factor below this are roundings: nothing is seen.
const NOTHING: f64 = 1e-12;

/// Doubt about a cell with an event inside, in units of its second and third Legendre coefficients.
const CROSSED: f64 = 0.05;

/// The same in units of the open form factor: events may bound a shadow or an opening that all nodes miss.
const BLIND: f64 = 1e-3;

/// Doubt about a cell without events, where singularities are near or several blockers act, in units of
/// its third coefficients, which fall below the errors of the rules where it is smooth.
const DOUBT: f64 = 1e-3;

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
    let division = Division::new(domain, target, blockers);
    let mut view = View::new(domain.normal, &target.outline, blockers);
    let mut queue: Vec<Patch> = Vec::new();
    division.start(domain, |cell, events| {
        queue.push(Patch::new(cell, events, &division, &mut view));
    });
    let mut sums = Sums::default();
    queue.iter().for_each(|patch| sums.add(patch, 1.0));
    let [visible, rest] = sums.routes(open);
    let by_hidden = rest.error < visible.error;
    queue.iter_mut().for_each(|patch| patch.rank(by_hidden));

    let mut queue = BinaryHeap::from(queue);
    let mut found = sums.result(open);
    let most = CELLS.min(CELLS_TIMES_BLOCKERS / blockers.len().max(1));
    let mut evaluated = queue.len();
    let enough = |found: Estimate| tolerance * found.value + 2.0 * NOTHING * open.value;
    while found.error > enough(found) && evaluated < most {
        let Some(worst) = queue.pop() else { break };
        sums.add(&worst, -1.0);
        for mut patch in worst.refined(&division, &mut view) {
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

    /// The visible part, and what the hidden part leaves of the open factor.
    ///
    /// Both parts together are the open factor, which is known: what the sum misses is an error of the rules
    /// that the visible part has its share of.
    fn routes(&self, open: Estimate) -> [Estimate; 2] {
        let missed = (self.visible.value + self.hidden.value - open.value).abs();
        let share = (self.visible.value / open.value).clamp(0.0, 1.0);
        [
            Estimate {
                value: self.visible.value,
                error: self.visible.error + missed * share,
            },
            Estimate {
                value: open.value - self.hidden.value,
                error: self.hidden.error + open.error,
            },
        ]
    }

    /// The better of the two.
    fn result(&self, open: Estimate) -> Estimate {
        let [visible, rest] = self.routes(open);
        let better = if visible.error < rest.error {
            visible
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
    fn new(cell: Cell, events: Vec<usize>, division: &Division, view: &mut View) -> Self {
        let (fine, samples) = product(&cell, FINE, view);
        let (coarse, _) = product(&cell, COARSE, view);
        let (second_s, third_s) = roughness(&samples, 4, 1);
        let (second_t, third_t) = roughness(&samples, 1, 4);
        let (second, third) = (second_s + second_t, third_s + third_t);
        let doubt = if !events.is_empty() {
            CROSSED * (second + third) + BLIND * (fine[0] + fine[1])
        } else if division.is_doubtful(&cell) {
            DOUBT * third
        } else {
            0.0
        };
        let [visible, hidden] = [0, 1].map(|k| Estimate {
            value: fine[k],
            error: (fine[k] - coarse[k]).abs() + doubt,
        });
        Self {
            cell,
            events,
            visible,
            hidden,
            is_rough_along_s: second_s + third_s > second_t + third_t,
            urgency: 0.0,
        }
    }

    /// The cell in parts: along an event inside, or halved.
    fn refined(self, division: &Division, view: &mut View) -> Vec<Patch> {
        let mut parts = Vec::with_capacity(2);
        division.refine(
            self.cell,
            &self.events,
            self.is_rough_along_s,
            &mut |cell, events| {
                parts.push(Patch::new(cell, events, division, view));
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
