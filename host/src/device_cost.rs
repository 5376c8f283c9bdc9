//! What an atlas costs on a microcontroller: flash, RAM and instructions of a frame, predicted.
//!
//! A frame of `n` elements and `k` lights with tables kept takes `n (a + b k)` instructions by the kernel that reads the atlas's
//! codes ([`relume::relight::full`], or [`relume::relight::full_any`]), and `f k` more when all tables are made anew. Where they
//! do not fit into the 16 KiB of a small core, [`relume::relight::Sums`] adds up light by light and fills a table for each. One
//! light that changes is corrected for in sums. The constants are fitted to what `tests/firmware` counts, which `tests/firmware.rs`
//! holds to 10 %, and to its images with other atlases of 240 to 1920 elements and 2 to 64 lights. On the M0 nothing of tiles was counted.

use relume::atlas::Atlas;
use relume::code::Code;
use relume::relight::table_length;

/// A core that the solver was counted on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Core {
    /// Cortex-M0, 16 KiB of RAM.
    M0,
    /// Cortex-M3.
    M3,
    /// Cortex-M4F.
    M4F,
}

impl Core {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::M0, Self::M3, Self::M4F];

    /// Bytes of RAM of the board that was counted.
    #[must_use]
    pub const fn ram(self) -> u64 {
        match self {
            Self::M0 => 16 << 10,
            Self::M3 | Self::M4F => 192 << 10,
        }
    }

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::M0 => "cortex-m0",
            Self::M3 => "cortex-m3",
            Self::M4F => "cortex-m4f",
        }
    }
}

/// Bytes of RAM that a small core has for tables.
const SMALL_TABLE: u64 = 12 << 10;

/// Predicted for one core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeviceCost {
    /// Bytes of flash: the atlas and the code that relights it.
    pub flash: u64,
    /// Bytes of RAM: tables, pixels and the stack. [`Core::ram`] may be less.
    pub ram: u64,
    /// Instructions of a frame in which every light changed.
    pub frame: u64,
    /// Instructions of a frame with tables kept, where there is room for them.
    pub warm: u64,
    /// Instructions of a frame in which one light changed.
    pub change: u64,
}

impl DeviceCost {
    /// Of an atlas of so many bytes.
    #[must_use]
    pub fn new(atlas: &Atlas, bytes: usize, core: Core) -> Self {
        let (elements, lights) = (atlas.element_count(), atlas.light_count());
        let (n, k) = (f64::from(elements), f64::from(lights));
        let model = Model::new(atlas, core);
        let sums = n * (model.element + model.light * k);
        let frame = sums + model.fill * k;
        Self {
            flash: bytes as u64 + model.code.of(lights),
            ram: model.tables + 2 * u64::from(elements) + model.stack.of(lights),
            frame: frame as u64,
            warm: if model.keeps_tables { sums } else { frame } as u64,
            change: (n * model.changed_element + model.changed_fills * model.fill) as u64,
        }
    }
}

/// Bytes that grow with the number of lights.
struct Bytes {
    fixed: u64,
    per_light: u64,
}

impl Bytes {
    const fn new(fixed: u64, per_light: u64) -> Self {
        Self { fixed, per_light }
    }

    fn of(&self, lights: u32) -> u64 {
        self.fixed + self.per_light * u64::from(lights)
    }
}

/// Constants of a kernel on a core.
struct Model {
    /// Instructions per element of a full frame.
    element: f64,
    /// Instructions per element and light of a full frame.
    light: f64,
    /// Instructions to make the table of a light.
    fill: f64,
    /// Whether all tables stay for the next frame.
    keeps_tables: bool,
    /// Instructions per element when one light changes.
    changed_element: f64,
    /// Tables that are made then.
    changed_fills: f64,
    /// Code and constants.
    code: Bytes,
    /// The stack, and what is kept of lights.
    stack: Bytes,
    /// Bytes of tables and sums.
    tables: u64,
}

impl Model {
    /// Of the kernel that reads an atlas.
    fn new(atlas: &Atlas, core: Core) -> Self {
        let lights = u64::from(atlas.light_count());
        if atlas.is_all_in(|code| code == Code::Lum8) {
            if core == Core::M0 && 1024 * lights > SMALL_TABLE {
                Self::luminance_in_batches(atlas)
            } else {
                Self::luminance(core, lights)
            }
        } else if atlas.is_all_in(|code| code.bytes() == 3) {
            Self::colour(atlas, core, lights)
        } else {
            Self::any(atlas, core)
        }
    }

    /// A table of luminance for every light.
    fn luminance(core: Core, lights: u64) -> Self {
        let is_small = core == Core::M0;
        // Compilers write the additions of so many lights out.
        let (element, light) = match lights {
            _ if is_small => (32.0, 5.0),
            ..=36 => (21.5, 3.41),
            _ => (17.3, 5.44),
        };
        let (fill, changed_element) = if is_small {
            (8_850.0, 34.0)
        } else {
            (6_040.0, 20.9)
        };
        Self {
            element,
            light,
            fill,
            keeps_tables: true,
            changed_element,
            changed_fills: 2.0,
            code: if is_small {
                Bytes::new(11_600, 196)
            } else {
                Bytes::new(17_600, 40)
            },
            stack: if is_small {
                Bytes::new(1_080, 34)
            } else {
                Bytes::new(870, 45)
            },
            tables: 1024 * lights,
        }
    }

    /// One table of luminance on the M0, filled for every light of every frame.
    fn luminance_in_batches(atlas: &Atlas) -> Self {
        Self {
            element: 36.0,
            light: 7.75,
            fill: 8_560.0,
            keeps_tables: false,
            changed_element: 34.0,
            changed_fills: 2.0,
            code: Bytes::new(13_500, 0),
            stack: Bytes::new(220, 78),
            tables: 1024 + 4 * u64::from(atlas.element_count()),
        }
    }

    /// Tables of three channels for every light.
    fn colour(atlas: &Atlas, core: Core, lights: u64) -> Self {
        let is_small = core == Core::M0;
        let (element, light) = match lights {
            _ if is_small => (27.5, 16.1),
            ..=12 => (29.3, 10.0),
            _ => (29.0, 17.45),
        };
        Self {
            element,
            light,
            fill: mean(atlas, |code| match (code, is_small) {
                (Code::Display8, true) => 142_000.0,
                (Code::Display8, false) => 60_000.0,
                (_, true) => 16_900.0,
                (_, false) => 6_900.0,
            }),
            keeps_tables: true,
            changed_element: if is_small { 47.2 } else { 29.9 },
            changed_fills: 1.0,
            code: if is_small {
                Bytes::new(21_000, 120)
            } else {
                Bytes::new(30_300, 60)
            },
            stack: if is_small {
                Bytes::new(1_320, 27)
            } else {
                Bytes::new(1_050, 42)
            },
            tables: 1536 * lights,
        }
    }

    /// Codes of any kind, tiles among them.
    fn any(atlas: &Atlas, core: Core) -> Self {
        let (tiled, byte, entry) = if core == Core::M0 {
            (900.0, 122.0, 165.0)
        } else {
            (509.0, 69.0, 70.0)
        };
        let element = 25.0;
        let light = mean(atlas, |code| if code.is_tiled() { tiled } else { byte });
        Self {
            element,
            light,
            fill: 3.0 * entry * atlas.levels() as f64,
            keeps_tables: true,
            changed_element: element + light * f64::from(atlas.light_count()),
            changed_fills: 1.0,
            code: Bytes::new(34_500, 150),
            stack: Bytes::new(7_000, 50),
            tables: 2 * table_length(atlas) as u64 + 6 * u64::from(atlas.element_count()),
        }
    }
}

/// The mean over all lights.
fn mean(atlas: &Atlas, of: impl Fn(Code) -> f64) -> f64 {
    let sum: f64 = atlas.lights().map(|light| of(light.code)).sum();
    sum / f64::from(atlas.light_count())
}
