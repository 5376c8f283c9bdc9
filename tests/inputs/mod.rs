//! What firmware is measured with: atlases, mixes and reflectances, and the pixels that they must give.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::Path;
use std::{fs, iter};

use relume::atlas::{Atlas, Quantity};
use relume::code::Code;
use relume::color::Rgb;
use relume::relight::{
    AnyTable, Colour, DecodeTable, Finish, Fitted, Form, FrameLight, FrameMix, Lum, Run,
    fill_table, full, full_any, relight, table_length,
};
use relume::tone::{Exposure, Rgb565Table, radiance};
use relume_host::bake::{Method, Settings, bake};
use relume_host::builtin::{PaperLamps, paper_room};
use relume_host::export::frame::{reflectances, runs};
use relume_host::import;
use relume_host::pack::{Format, Packing, pack};
use relume_host::scene::OwnedScene;
use relume_host::solution::Solution;

#[path = "../firmware/src/drawn.rs"]
pub mod device_drawn;
#[path = "../firmware/src/room.rs"]
pub mod device_room;

/// As in the images.
pub static TONE: Rgb565Table = Rgb565Table::new(1024);

/// An atlas and what is to be made of it.
#[derive(Debug)]
pub struct Input {
    /// Kernel-independent name: code, elements, lights.
    pub name: &'static str,
    /// The atlas.
    pub atlas: Vec<u8>,
    /// Runs of reflectances.
    pub runs: Vec<Run>,
    /// The largest weight of every light.
    pub full: Vec<Rgb>,
    /// Two mixes.
    pub levels: [Vec<[u16; 3]>; 2],
    /// The 98th percentile of luminance of all lights is white.
    pub exposure: f32,
}

/// Elements of 0.25 m in patches of 1 m.
fn solved(scene: &OwnedScene) -> Solution {
    let settings = Settings {
        patch: Some(1.001),
        element: Some(0.2501),
        residual: 1e-4,
        method: Method::Rows,
        variation: f64::INFINITY,
        ..Settings::default()
    };
    bake(scene, &settings, &mut |_| ControlFlow::Continue(())).expect("a legal scene")
}

/// The four inputs.
pub fn inputs() -> Vec<Input> {
    let room = solved(&paper_room(PaperLamps::Eight).expect("a legal scene").scene);
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes");
    let moving = import::load(&scenes.join("moving_light.obj"), None).expect("our own scene");
    let moving = solved(&moving.scene);
    let (irradiance, radiosity) = (Quantity::Irradiance, Quantity::Radiosity);
    vec![
        input("lum_960x8", &room, Code::Lum8.into(), irradiance),
        input("rgb_960x8", &room, Code::Display8.into(), radiosity),
        input("tiles_960x8", &room, Code::Tiles.into(), irradiance),
        input("lum_1920x30", &moving, Code::Lum8.into(), irradiance),
    ]
}

/// An atlas of a solution without its mesh, its reflectances, and two mixes.
pub fn input(
    name: &'static str,
    solution: &Solution,
    packing: Packing,
    quantity: Quantity,
) -> Input {
    let format = Format {
        packing,
        quantity,
        mesh: false,
    };
    let atlas = pack(solution, format).expect("it can be packed");
    let parsed = Atlas::parse(&atlas).expect("it was just packed");
    let (elements, lights) = (parsed.element_count(), parsed.light_count());
    if let Some((_, shape)) = name.split_once('_') {
        assert_eq!(shape, format!("{elements}x{lights}"), "{name}");
    }
    let runs = match quantity {
        Quantity::Irradiance => runs(solution.mesh.elements.iter().map(|e| e.reflectance)),
        _ => vec![Run {
            elements,
            reflectance: [u16::MAX; 3],
        }],
    };
    let full: Vec<Rgb> = parsed.lights().map(|light| light.emission).collect();
    let exposure = {
        let lit = relit(&parsed, &full);
        let mut shown: Vec<f32> = iter::zip(lit, reflectances(&runs))
            .map(|(lit, reflectance)| radiance(reflectance, lit, Rgb::BLACK).luminance())
            .collect();
        shown.sort_by(f32::total_cmp);
        Exposure::for_white(shown[shown.len() * 98 / 100]).factor()
    };
    // Some brightness and some colour for every light, another one in the second mix.
    let level = |light: u32, channel: u32, mix: u32| {
        let mixed = (light * 977 + channel * 131 + mix * 389).wrapping_mul(0x9e37_79b1) >> 16;
        (0x4000 + mixed % 0xc000) as u16
    };
    let levels = [0, 1].map(|mix| {
        let of = |light| [0, 1, 2].map(|channel| level(light, channel, mix));
        (0..lights).map(of).collect()
    });
    Input {
        name,
        runs,
        full,
        levels,
        exposure,
        atlas,
    }
}

/// The `f32` relight.
pub fn relit(atlas: &Atlas, mix: &[Rgb]) -> Vec<Rgb> {
    let mut values = vec![0.0; table_length(atlas)];
    let table = DecodeTable::new(atlas, &mut values).expect("it is long enough");
    let mut irradiance = vec![Rgb::BLACK; atlas.element_count() as usize];
    relight(atlas, &table, mix, &mut irradiance).expect("a legal mix");
    irradiance
}

/// FNV-1a, 32 bits, of the bytes of pixels, low byte first.
pub fn hash(pixels: &[u16]) -> u32 {
    let bytes = pixels.iter().flat_map(|pixel| pixel.to_le_bytes());
    bytes.fold(0x811c_9dc5, |hash, byte| {
        (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
    })
}

impl Input {
    /// The pixels of a mix by `f32` and the tone functions.
    pub fn in_floats(&self, levels: &[[u16; 3]]) -> Vec<u16> {
        let atlas = Atlas::parse(&self.atlas).expect("an atlas");
        let mix: Vec<Rgb> = iter::zip(&self.full, levels)
            .map(|(full, levels)| *full * Rgb::from_array(levels.map(|l| f32::from(l) / 65_536.0)))
            .collect();
        let exposure = Exposure::new(self.exposure).expect("positive");
        iter::zip(relit(&atlas, &mix), reflectances(&self.runs))
            .map(|(lit, reflectance)| exposure.rgb565(radiance(reflectance, lit, Rgb::BLACK)))
            .collect()
    }

    /// The same by the kernel that reads these codes.
    pub fn in_integers(&self, levels: &[[u16; 3]]) -> Vec<u16> {
        let atlas = Atlas::parse(&self.atlas).expect("an atlas");
        let mut room = vec![FrameLight::EMPTY; self.full.len()];
        let mut mix = FrameMix::new(&atlas, &self.full, &mut room).expect("a legal mix");
        for (light, levels) in (0..).zip(levels) {
            mix.set(light, *levels);
        }
        let finish = Finish::new(&atlas, &mix, &self.runs, self.exposure, &TONE);
        let finish = finish.expect("the exposure is not that far from white");
        let mut pixels = vec![0; atlas.element_count() as usize];
        match self.name {
            "lum_960x8" => self.table::<Lum, 8>(&mix, &finish, &mut pixels),
            "lum_1920x30" => self.table::<Lum, 30>(&mix, &finish, &mut pixels),
            "rgb_960x8" => self.table::<Colour, 8>(&mix, &finish, &mut pixels),
            "cornell" => self.table::<Colour, 1>(&mix, &finish, &mut pixels),
            _ => {
                let mut values = vec![0; table_length(&atlas)];
                let table = AnyTable::new(&atlas, &mix, &mut values).expect("it fits");
                let mut sums = vec![[0; 3]; pixels.len()];
                full_any(&atlas, &table, &finish, &mut sums, &mut pixels).expect("it fits");
            }
        }
        pixels
    }

    fn table<F: Form, const K: usize>(
        &self,
        mix: &FrameMix,
        finish: &Finish<Rgb565Table>,
        pixels: &mut [u16],
    ) {
        let atlas = Atlas::parse(&self.atlas).expect("an atlas");
        let mut tables = [F::EMPTY; K];
        for (light, table) in (0..).zip(&mut tables) {
            fill_table::<F>(&atlas, mix, light, table).expect("a light");
        }
        full::<F, K, _>(&atlas, &tables, finish, pixels).expect("it fits");
    }

    /// Writes the atlas, and Rust that includes it.
    pub fn write(&self, folder: &Path) {
        let atlas = Atlas::parse(&self.atlas).expect("an atlas");
        let path = folder.join(self.name).with_extension("atlas");
        let lights = self.full.len();
        let mut text = String::new();
        for (what, name, count) in [
            (
                "Entries of a table of all codes",
                "LEVELS",
                table_length(&atlas),
            ),
            (
                "Pixels of a frame",
                "ELEMENTS",
                atlas.element_count() as usize,
            ),
        ] {
            let _ = writeln!(text, "/// {what}.\n#[allow(dead_code)]");
            let _ = writeln!(text, "const {name}: usize = {count};");
        }
        let _ = writeln!(text, "static INPUT: Input<{lights}> = Input {{");
        let _ = writeln!(text, "    atlas: include_bytes!({path:?}),\n    full: [");
        for Rgb { r, g, b } in &self.full {
            let _ = writeln!(
                text,
                "        relume::color::Rgb::new({r:?}, {g:?}, {b:?}),"
            );
        }
        let _ = writeln!(text, "    ],\n    levels: {:?},\n    runs: &[", self.levels);
        for Run {
            elements,
            reflectance,
        } in &self.runs
        {
            let _ = writeln!(
                text,
                "        relume::relight::Run {{ elements: {elements}, reflectance: {reflectance:?} }},"
            );
        }
        let _ = writeln!(text, "    ],\n    exposure: {:?},\n}};", self.exposure);
        write_if_new(&path, &self.atlas);
        write_if_new(&path.with_extension("rs"), text.as_bytes());
        if let Ok(full) = <&[Rgb; 8]>::try_from(self.full.as_slice())
            && self.name.starts_with("lum")
        {
            let fitted = Fitted::new(&atlas, full, &self.runs, self.exposure, &TONE);
            let fitted = fitted.expect("the exposure is not that far from white");
            let Self { levels, runs, .. } = self;
            let text = format!(
                "use firmware::kernels::FittedInput;\nuse relume::relight::{{Fitted, Run}};\n\n\
                 static INPUT: FittedInput<{lights}> = FittedInput {{\n    atlas: include_bytes!({path:?}),\n    \
                 fitted: {fitted:?},\n    levels: {levels:?},\n    runs: &{runs:?},\n}};\n"
            );
            let path = folder.join(format!("{}_fitted.rs", self.name));
            write_if_new(&path, text.as_bytes());
        }
    }
}

/// The room of the moving light, whose 30 patches are no lamps here; one of 0.5 m hangs under the ceiling.
pub fn moving_polygons() -> Vec<device_room::Polygon> {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes");
    let moving = import::load(&scenes.join("moving_light.obj"), None).expect("our own scene");
    let surfaces = moving.scene.surfaces.iter();
    let dark = surfaces.filter(|surface| surface.emission().is_none());
    let mut polygons: Vec<_> = dark.map(polygon).collect();
    let corners =
        [[2.75, 1.25], [3.25, 1.25], [3.25, 1.75], [2.75, 1.75]].map(|[x, z]| [x, 2.9, z]);
    polygons.push((corners, [0.0; 3], Some(0)));
    polygons
}

fn polygon(surface: &relume::scene::Surface) -> device_room::Polygon {
    let mut vertices = [[0.0; 3]; 4];
    for (to, from) in vertices.iter_mut().zip(surface.polygon().vertices()) {
        *to = from.to_array();
    }
    let reflectance = surface.reflectance().get().to_array();
    (vertices, reflectance, surface.emission().map(|e| e.light))
}

/// The atlas, with its mesh, of the paper's room with three lamps.
pub fn drawn_atlas() -> Vec<u8> {
    let room = solved(&paper_room(PaperLamps::Three).expect("a legal scene").scene);
    let format = Format {
        packing: Code::Display8.into(),
        quantity: Quantity::Radiosity,
        mesh: true,
    };
    pack(&room, format).expect("it can be packed")
}

/// The paper's room with three lamps: what `room` of the firmware bakes.
pub fn room_polygons() -> Vec<device_room::Polygon> {
    let room = paper_room(PaperLamps::Three).expect("a legal scene");
    room.scene.surfaces.iter().map(polygon).collect()
}

/// Leaves a file alone that holds just this, so that nothing is built again.
pub fn write_if_new(path: &Path, bytes: &[u8]) {
    if fs::read(path).ok().as_deref() != Some(bytes) {
        fs::write(path, bytes).expect("a folder that can be written to");
    }
}
