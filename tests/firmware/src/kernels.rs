//! What the images do: one kernel each, from its atlas to the hash of its pixels.

use core::hint::black_box;

use relume::atlas::Atlas;
use relume::color::Rgb;
use relume::relight::{
    AnyTable, Colour, Finish, Fitted, Form, FrameLight, FrameMix, Lum, Run, Sums, fill_table, full,
    full_any,
};
use relume::tone::Rgb565Table;

use crate::{Hash, count, count_with_pauses, exit, hash, largest_stack, paint_stack, say};

/// White at half of the steps: twice as bright is still told apart from more.
static TONE: Rgb565Table = Rgb565Table::new(1024);

/// An atlas of `K` lights and what is to be made of it.
pub struct Input<const K: usize> {
    /// Its bytes.
    pub atlas: &'static [u8],
    /// The largest weight of every light.
    pub full: [Rgb; K],
    /// Two mixes, in levels.
    pub levels: [[[u16; 3]; K]; 2],
    /// Reflectances.
    pub runs: &'static [Run],
    /// Radiance times this is 1 at white.
    pub exposure: f32,
}

/// The light that changes where one does.
const CHANGED: u32 = 1;

/// A result, or the end.
fn must<T, E>(result: Result<T, E>) -> T {
    match result {
        Ok(value) => value,
        Err(_) => exit(1),
    }
}

/// The end, unless both are the same.
fn same(a: u32, b: u32) {
    if a != b {
        exit(1);
    }
}

/// Levels that the compiler does not know.
#[inline(never)]
fn volatile<const K: usize>(levels: &[[u16; 3]; K]) -> [[u16; 3]; K] {
    let mut read = [[0; 3]; K];
    for (to, from) in read
        .as_flattened_mut()
        .iter_mut()
        .zip(levels.as_flattened())
    {
        // SAFETY: a reference to a plain value.
        *to = unsafe { core::ptr::read_volatile(from) };
        black_box(());
    }
    read
}

/// What comes before the first frame.
struct Ready {
    atlas: Atlas<'static>,
    mix: FrameMix<'static>,
    finish: Finish<'static, Rgb565Table>,
}

/// With a stack of its own, which is free again afterwards.
#[inline(never)]
fn parsed<F: Form>(bytes: &'static [u8]) -> Atlas<'static> {
    must(F::parse(bytes))
}

/// Reads an atlas for the kernels of a form.
#[inline(never)]
fn ready<F: Form, const K: usize>(
    input: &'static Input<K>,
    room: &'static mut [FrameLight; K],
) -> Ready {
    let atlas = parsed::<F>(input.atlas);
    let mix = must(F::mix(&atlas, &input.full, room));
    let finish = must(Finish::new(&atlas, &mix, input.runs, input.exposure, &TONE));
    Ready { atlas, mix, finish }
}

#[inline(never)]
fn set_all(mix: &mut FrameMix, levels: &[[u16; 3]]) {
    for (light, levels) in (0..).zip(levels) {
        mix.set(light, *levels);
        black_box(());
    }
}

/// With the feature `one-index` a panic path, which no image may have.
fn one_index(pixels: &[u16], at: u32) {
    #[cfg(feature = "one-index")]
    black_box(pixels[black_box(at) as usize]);
    #[cfg(not(feature = "one-index"))]
    let _ = (pixels, at);
}

#[inline(never)]
fn report(per_frame: u32, warm: u32, hash: u32) -> ! {
    say(c"per_frame", per_frame);
    say(c"per_frame_warm", warm);
    say(c"hash", hash);
    say(c"stack", largest_stack());
    exit(0)
}

/// Frames from the tables of all lights.
pub fn run_full<F: Form, const K: usize>(
    input: &'static Input<K>,
    room: &'static mut [FrameLight; K],
    tables: &'static mut [F::Table; K],
    pixels: &'static mut [u16],
) -> ! {
    paint_stack();
    let [first, second] = input.levels.each_ref().map(volatile);
    let mut ready = ready::<F, K>(input, room);
    let Ready { atlas, mix, finish } = &mut ready;
    let mut frame = |levels: &[[u16; 3]; K], tables: &mut [F::Table; K], pixels: &mut [u16]| {
        set_all(mix, levels);
        for (light, table) in (0..).zip(tables.iter_mut()) {
            must(fill_table::<F>(atlas, mix, light, table));
        }
        must(full::<F, K, _>(atlas, black_box(tables), finish, pixels));
    };
    frame(&first, tables, pixels);
    let cold = count(|| frame(&second, tables, pixels));
    let cold_hash = hash(pixels);
    pixels.fill(0);
    let warm = count(|| must(full::<F, K, _>(atlas, black_box(tables), finish, pixels)));
    same(cold_hash, hash(pixels));
    report(cold, warm, cold_hash)
}

/// Frames whose tables do not fit into memory together.
pub fn run_sums<F: Form, const K: usize>(
    input: &'static Input<K>,
    room: &'static mut [FrameLight; K],
    sums: &'static mut [F::Sum],
    table: &'static mut F::Table,
    pixels: &'static mut [u16],
) -> ! {
    paint_stack();
    let [_, second] = input.levels.each_ref().map(volatile);
    let mut ready = ready::<F, K>(input, room);
    let Ready { atlas, mix, finish } = &mut ready;
    let cold = count(|| {
        set_all(mix, &second);
        let sums = must(Sums::<F, K>::new(atlas, mix, sums, table));
        must(sums.show(finish, pixels));
    });
    report(cold, cold, hash(pixels))
}

/// An atlas of `K` lights that a host fitted.
pub struct FittedInput<const K: usize> {
    /// Its bytes.
    pub atlas: &'static [u8],
    /// What the host found.
    pub fitted: Fitted<K>,
    /// Two mixes, in levels.
    pub levels: [[[u16; 3]; K]; 2],
    /// Reflectances.
    pub runs: &'static [Run],
}

/// A frame that is sent to a display, strip after strip.
type Sent<'a> = &'a mut dyn FnMut(&mut dyn FnMut(&[u16]));

/// The instructions of a frame, and its hash; nothing of what makes the hash is counted.
#[inline(never)]
fn count_strips(frame: Sent) -> (u32, u32) {
    let (mut hash, mut strips) = (Hash::new(), 0);
    let mut counted = |frame: Sent| {
        let counted = count_with_pauses(|pause| {
            frame(&mut |strip| {
                strips += 1;
                pause.during(|| hash.add(strip));
            });
        });
        (counted, core::mem::take(&mut strips))
    };
    // What a strip of nothing takes.
    let (one, _) = counted(&mut |send| send(&[]));
    let (two, _) = counted(&mut |send| {
        send(&[]);
        send(&[]);
    });
    let (all, strips) = counted(frame);
    (all - strips * (two - one), hash.sum())
}

/// One changed light of an atlas that a host fitted, and back; a display is sent strips.
pub fn run_change_fitted<const K: usize>(
    input: &'static FittedInput<K>,
    room: &'static mut [FrameLight; K],
    sums: &'static mut [u32],
    table: &'static mut <Lum as Form>::Table,
    strip: &'static mut [u16],
) -> ! {
    paint_stack();
    let [first, second] = input.levels.each_ref().map(volatile);
    let light = CHANGED as usize;
    let (Some(before), Some(after)) = (first.get(light), second.get(light)) else {
        exit(1)
    };
    // Borrowed where they are: moving an atlas takes the code of `memcpy`.
    let Ok(atlas) = &input.fitted.atlas(input.atlas) else {
        exit(1)
    };
    let Ok(finish) = &input.fitted.finish(atlas, input.runs, &TONE) else {
        exit(1)
    };
    let mix = &mut input.fitted.mix(room);
    set_all(mix, &first);
    let Ok(kept) = &mut Sums::<Lum, K>::new(atlas, mix, sums, table) else {
        exit(1)
    };
    let (_, unchanged) = count_strips(&mut |send| must(kept.show_strips(finish, strip, send)));
    let (cold, changed) = count_strips(&mut |send| {
        must(kept.change(atlas, mix, (CHANGED, *after)));
        must(kept.show_strips(finish, strip, send));
    });
    one_index(strip, changed);
    must(kept.set(atlas, mix, (CHANGED, *before)));
    // What is left when the table is there already.
    let (warm, undone) = count_strips(&mut |send| {
        kept.apply(CHANGED);
        must(kept.show_strips(finish, strip, send));
    });
    same(unchanged, undone);
    report(cold, warm, changed)
}

/// One changed light, and back.
pub fn run_change<F: Form, const K: usize>(
    input: &'static Input<K>,
    room: &'static mut [FrameLight; K],
    sums: &'static mut [F::Sum],
    table: &'static mut F::Table,
    pixels: &'static mut [u16],
) -> ! {
    paint_stack();
    let [first, second] = input.levels.each_ref().map(volatile);
    let light = CHANGED as usize;
    let (Some(before), Some(after)) = (first.get(light), second.get(light)) else {
        exit(1)
    };
    let mut ready = ready::<F, K>(input, room);
    let Ready { atlas, mix, finish } = &mut ready;
    set_all(mix, &first);
    let mut kept = must(Sums::<F, K>::new(atlas, mix, sums, table));
    must(kept.show(finish, pixels));
    let unchanged = hash(pixels);
    let cold = count(|| {
        must(kept.change(atlas, mix, (CHANGED, *after)));
        must(kept.show(finish, pixels));
    });
    let changed = hash(pixels);
    one_index(pixels, changed);
    must(kept.set(atlas, mix, (CHANGED, *before)));
    // What is left when the table is there already.
    let warm = count(|| {
        kept.apply(CHANGED);
        must(kept.show(finish, pixels));
    });
    same(unchanged, hash(pixels));
    report(cold, warm, changed)
}

/// Frames from codes of any kind.
pub fn run_any<const K: usize>(
    input: &'static Input<K>,
    room: &'static mut [FrameLight; K],
    values: &'static mut [u16],
    sums: &'static mut [[u16; 3]],
    pixels: &'static mut [u16],
) -> ! {
    paint_stack();
    let [first, second] = input.levels.each_ref().map(volatile);
    let mut ready = ready::<Colour, K>(input, room);
    let Ready { atlas, mix, finish } = &mut ready;
    set_all(mix, &first);
    let mut table = must(AnyTable::new(atlas, mix, values));
    let cold = count(|| {
        set_all(mix, &second);
        for light in 0..atlas.light_count() {
            must(table.update(atlas, mix, light));
        }
        must(full_any(atlas, &table, finish, sums, pixels));
    });
    let cold_hash = hash(pixels);
    pixels.fill(0);
    let warm = count(|| must(full_any(atlas, &table, finish, sums, pixels)));
    same(cold_hash, hash(pixels));
    report(cold, warm, cold_hash)
}
