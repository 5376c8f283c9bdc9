//! Stabilised bi-conjugate gradients for all lanes at once: `x` with `A x = b`, `A` close to one.
//!
//! van der Vorst 1992, BiCGSTAB. Each lane (one light, one channel) has scalars of its own and stops by itself, so
//! its result does not depend on what its neighbours hold. For `A = 1 - G`, with `G` a reflection
//! of spectral radius below one, the steps are nearly independent of the reflectance (notes: 6 to 19 where sweeps
//! need 95). Each run starts with a plain step, `x += r`, so that it begins with light that was reflected:
//! what a black lamp emits is orthogonal to all that follows. A lane whose scalars break down waits
//! for the next run.

use super::Lanes;

/// Most steps of one run.
const STEPS: usize = 48;

/// Most runs.
const RUNS: usize = 4;

/// Memory of a solve, as many lanes in each as the system has unknowns.
#[derive(Debug)]
pub struct Work<'a, const K: usize> {
    /// The residual that a run starts with.
    pub shadow: &'a mut [Lanes<K>],
    /// The direction of a step.
    pub direction: &'a mut [Lanes<K>],
    /// What the system makes of it.
    pub along: &'a mut [Lanes<K>],
    /// What the system makes of the residual after it.
    pub across: &'a mut [Lanes<K>],
}

/// Adds to `x` until the residual `r = b - A x` of every lane is `tolerance` of what it was.
///
/// `apply(v, y)` sets `y = A v`. `r` is `b - A x` on entry and stays it.
pub fn solve<const K: usize>(
    mut apply: impl FnMut(&[Lanes<K>], &mut [Lanes<K>]),
    x: &mut [Lanes<K>],
    r: &mut [Lanes<K>],
    work: Work<K>,
    tolerance: f32,
) {
    let Work {
        shadow,
        direction,
        along,
        across,
    } = work;
    let goal = dot(r, r).map(|channel| channel.map(|square| square * tolerance * tolerance));
    let unfinished = |r: &[Lanes<K>]| each(dot(r, r), goal, |square, goal| yes(square > goal));

    for _ in 0..RUNS {
        let mut under_way = unfinished(r);
        if is_dark(&under_way) {
            return;
        }
        copy(shadow, r);
        apply(shadow, along);
        step(x, shadow, &under_way);
        step(r, along, &negative(under_way));
        copy(shadow, r);
        direction.fill([[0.0; K]; 3]);
        along.fill([[0.0; K]; 3]);
        let (mut rho, mut alpha, mut omega) = ([[1.0; K]; 3], [[1.0; K]; 3], [[1.0; K]; 3]);

        for _ in 0..STEPS {
            under_way = each(under_way, unfinished(r), |a, b| a * b);
            if is_dark(&under_way) {
                break;
            }
            let next = dot(shadow, r);
            let beta = each(ratio(next, rho), ratio(alpha, omega), |a, b| a * b);
            rho = next;
            for ((p, v), r) in direction.iter_mut().zip(along.iter()).zip(r.iter()) {
                // p = r + beta (p - omega v)
                let back = each(*p, each(omega, *v, |a, b| a * b), |p, v| p - v);
                *p = each(*r, each(beta, back, |a, b| a * b), |r, b| r + b);
            }
            apply(direction, along);
            alpha = masked(ratio(rho, dot(shadow, along)), &under_way);
            step(r, along, &negative(alpha));
            step(x, direction, &alpha);
            apply(r, across);
            omega = masked(ratio(dot(across, r), dot(across, across)), &under_way);
            step(x, r, &omega);
            step(r, across, &negative(omega));
            let moves = each(alpha, omega, |a, b| yes(a != 0.0 && b != 0.0));
            under_way = each(under_way, moves, |a, b| a * b);
        }
    }
}

fn copy<const K: usize>(to: &mut [Lanes<K>], from: &[Lanes<K>]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}

fn is_dark<const K: usize>(lanes: &Lanes<K>) -> bool {
    lanes.as_flattened().iter().all(|lane| *lane == 0.0)
}

fn negative<const K: usize>(lanes: Lanes<K>) -> Lanes<K> {
    lanes.map(|channel| channel.map(|value| -value))
}

const fn yes(condition: bool) -> f32 {
    if condition { 1.0 } else { 0.0 }
}

fn each<const K: usize>(a: Lanes<K>, b: Lanes<K>, f: impl Fn(f32, f32) -> f32) -> Lanes<K> {
    let mut result = a;
    for (channel, other) in result.iter_mut().zip(&b) {
        for (value, other) in channel.iter_mut().zip(other) {
            *value = f(*value, *other);
        }
    }
    result
}

/// `a / b`, or 0 where that is not a number to go on with.
fn ratio<const K: usize>(a: Lanes<K>, b: Lanes<K>) -> Lanes<K> {
    each(a, b, |a, b| {
        let quotient = a / b;
        if quotient.is_finite() { quotient } else { 0.0 }
    })
}

fn masked<const K: usize>(lanes: Lanes<K>, under_way: &Lanes<K>) -> Lanes<K> {
    each(
        lanes,
        *under_way,
        |value, on| {
            if on == 0.0 { 0.0 } else { value }
        },
    )
}

fn dot<const K: usize>(a: &[Lanes<K>], b: &[Lanes<K>]) -> Lanes<K> {
    let mut sum = [[0.0; K]; 3];
    for (a, b) in a.iter().zip(b) {
        for ((sum, a), b) in sum.iter_mut().zip(a).zip(b) {
            for ((sum, a), b) in sum.iter_mut().zip(a).zip(b) {
                *sum += a * b;
            }
        }
    }
    sum
}

/// `x += factor * v`.
fn step<const K: usize>(x: &mut [Lanes<K>], v: &[Lanes<K>], factor: &Lanes<K>) {
    for (x, v) in x.iter_mut().zip(v) {
        for ((x, v), factor) in x.iter_mut().zip(v).zip(factor) {
            for ((x, v), factor) in x.iter_mut().zip(v).zip(factor) {
                *x += factor * v;
            }
        }
    }
}
