//! Sums over codes that are bytes, in four lanes: red, green, blue and one that is not used.
//!
//! Four elements grow together: an addition waits for the one before it in the same sum, and what one element looked up
//! of a light is still near for the next. Sums do not depend on it, as every element meets its lights in the order of their tags.

use crate::atlas::{Atlas, Group};

/// The values of all codes of a light: of red, green and blue.
pub(super) type Values<T> = [[T; 256]; 3];

/// A sum that grows in four lanes.
pub(super) trait Sum: Copy {
    /// What the codes of a light stand for.
    type Value: Copy + Default;
    /// What is known of a light besides.
    type Weight: Copy;

    fn to_lanes(self) -> [Self::Value; 4];

    fn from_lanes(lanes: [Self::Value; 4]) -> Self;

    /// The values of a code of luminance.
    fn of_luminance(values: &Values<Self::Value>, code: u8) -> [Self::Value; 4];

    /// Adds what a light contributes.
    fn add(
        sum: [Self::Value; 4],
        weight: Self::Weight,
        values: [Self::Value; 4],
    ) -> [Self::Value; 4];
}

/// Adds all lights to the sums of all elements; `tables` has an entry per light, or none at all, and `weights` has one, too.
/// `add` adds what is in none of the tables.
pub(super) fn add_all<'v, S: Sum<Value: 'v>>(
    atlas: &Atlas,
    tables: &'v [Values<S::Value>],
    weights: impl Iterator<Item = S::Weight> + Clone,
    sums: &mut [S],
    add: impl Fn(&mut S, u32, [u16; 3]),
) {
    let groups = atlas.groups().filter(|_| !tables.is_empty());
    let mut lights = tables.iter().zip(weights);
    for group in groups {
        add_group(&group, lights.clone().take(group.lights), sums);
        lights.by_ref().take(group.lights).for_each(drop);
    }
    let add = |element: u32, light, codes| {
        if let Some(sum) = sums.get_mut(element as usize) {
            add(sum, light, codes);
        }
    };
    if tables.is_empty() {
        atlas.for_each(add);
    } else {
        atlas.for_each_in_tiles(None, add);
    }
}

/// Adds a group of lights to the sums of all elements; `lights` are their values and weights.
fn add_group<'v, S: Sum<Value: 'v>>(
    group: &Group,
    lights: impl Iterator<Item = (&'v Values<S::Value>, S::Weight)> + Clone,
    sums: &mut [S],
) {
    match group.code_bytes {
        1 => add_rows(group.rows(), lights, sums, |values, [code]| {
            S::of_luminance(values, *code)
        }),
        3 => add_rows(group.rows(), lights, sums, |values, codes| {
            of_colour(values, *codes)
        }),
        _ => {}
    }
}

fn add_rows<'c, 'v, S: Sum<Value: 'v>, const N: usize>(
    mut rows: impl Iterator<Item = &'c [[u8; N]]>,
    lights: impl Iterator<Item = (&'v Values<S::Value>, S::Weight)> + Clone,
    sums: &mut [S],
    values: impl Fn(&Values<S::Value>, &[u8; N]) -> [S::Value; 4],
) {
    for sums in sums.chunks_mut(4) {
        let Some(a) = rows.next() else { return };
        // After the last element comes the first of these again, for nothing.
        let [b, c, d] = [(); 3].map(|()| rows.next().unwrap_or(a));
        let mut together = [[S::Value::default(); 4]; 4];
        for (lanes, sum) in together.iter_mut().zip(&*sums) {
            *lanes = sum.to_lanes();
        }
        let [mut p, mut q, mut r, mut s] = together;
        let codes = a.iter().zip(b).zip(c).zip(d);
        for ((((a, b), c), d), (table, weight)) in codes.zip(lights.clone()) {
            p = S::add(p, weight, values(table, a));
            q = S::add(q, weight, values(table, b));
            r = S::add(r, weight, values(table, c));
            s = S::add(s, weight, values(table, d));
        }
        for (sum, lanes) in sums.iter_mut().zip([p, q, r, s]) {
            *sum = S::from_lanes(lanes);
        }
    }
}

/// The values of a code of three channels.
#[inline(always)]
pub(super) fn of_colour<T: Copy + Default>(values: &Values<T>, [r, g, b]: [u8; 3]) -> [T; 4] {
    let [reds, greens, blues] = values;
    [of(reds, r), of(greens, g), of(blues, b), T::default()]
}

#[inline(always)]
pub(super) fn of<T: Copy>(values: &[T; 256], code: u8) -> T {
    // A byte is below 256.
    #[allow(clippy::indexing_slicing)]
    values[usize::from(code)]
}
