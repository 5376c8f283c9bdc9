//! Atlases, with the length and a checksum that match: parsed, read through, relit in every kernel.
#![no_main]

use libfuzzer_sys::fuzz_target;
use relume::atlas::Atlas;
use relume::color::Rgb;
use relume::relight::{
    DecodeTable, FixedMix, FixedTable, FixedWeight, Wide, WideWeight, change_fixed, relight,
    relight_fixed, relight_wide, table_length,
};
use relume_fuzz::{sign, within};
use relume_host::pack::unpack;

const LENGTH_AT: usize = 16;
const CHECKSUM_AT: usize = 20;

/// Most contributions and table entries that are gone through: time, not memory.
const MOST: u64 = 1 << 18;

fuzz_target!(|bytes: &[u8]| {
    let mut signed = bytes.to_vec();
    if let Some(length) = signed.get_mut(LENGTH_AT..CHECKSUM_AT) {
        length.copy_from_slice(&(bytes.len() as u32).to_le_bytes());
    }
    sign(&mut signed, CHECKSUM_AT);
    let parsed = within(0, || {
        let _ = Atlas::parse(bytes);
        Atlas::parse(&signed)
    });
    let Ok(atlas) = parsed else {
        return;
    };
    let values = u64::from(atlas.element_count()) * u64::from(atlas.light_count());
    if values > MOST || table_length(&atlas) as u64 > MOST {
        return;
    }
    within(0, || read_through(&atlas));
    relight_all(&atlas);
    let room = 4096 + 16 * values as usize + 4 * table_length(&atlas) + 16 * bytes.len();
    let solution = within(room, || unpack(&atlas));
    assert_eq!(solution.unwrap().contributions.len() as u64, values);
});

/// Everything that the atlas says is within what it says of itself.
fn read_through(atlas: &Atlas) {
    assert_eq!(atlas.lights().count(), atlas.light_count() as usize);
    atlas.for_each(|element, light, codes| {
        assert!(element < atlas.element_count());
        let last = atlas.lights().nth(light as usize).map(|light| light.last);
        let within = codes.iter().zip(last.unwrap()).all(|(c, last)| *c <= last);
        assert!(within);
    });
    if let Some(mesh) = atlas.mesh() {
        assert!((0..mesh.surface_count()).all(|s| mesh.surface(s).is_some()));
        assert!((0..mesh.face_count()).all(|f| mesh.face(f).is_some()));
        assert!((0..mesh.element_count()).all(|e| mesh.element(e).is_some()));
    }
}

/// Every kernel takes what the atlas holds; the two in integers agree, and a change can be undone.
fn relight_all(atlas: &Atlas) {
    let (n, k) = (atlas.element_count() as usize, atlas.light_count() as usize);
    let mix: Vec<Rgb> = atlas.lights().map(|light| light.emission).collect();

    let mut values = vec![0.0; table_length(atlas)];
    let table = DecodeTable::new(atlas, &mut values).unwrap();
    relight(atlas, &table, &mix, &mut vec![Rgb::BLACK; n]).unwrap();
    let mut weights = vec![WideWeight::EMPTY; k];
    relight_wide(atlas, &mix, &mut weights, &mut vec![[Wide::ZERO; 3]; n]).unwrap();

    let mut weights = vec![FixedWeight::EMPTY; k];
    let Ok(mut fixed) = FixedMix::new(atlas, &mix, &mix, &mut weights) else {
        return;
    };
    let mut sums = vec![[0; 3]; n];
    relight_fixed(atlas, &fixed, &mut sums).unwrap();
    let mut values = vec![0; table_length(atlas)];
    let table = FixedTable::new(atlas, &fixed, &mut values).unwrap();
    let mut by_table = vec![[0; 3]; n];
    relight_fixed(atlas, &table, &mut by_table).unwrap();
    assert_eq!(sums, by_table);
    let last = (0..).zip(&mix).last();
    if let Some((light, nominal)) = last {
        change_fixed(atlas, &mut fixed, light, Rgb::BLACK, &mut sums).unwrap();
        change_fixed(atlas, &mut fixed, light, *nominal, &mut sums).unwrap();
        assert_eq!(sums, by_table);
    }
}
