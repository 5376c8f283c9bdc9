//! What an atlas costs on a microcontroller: flash, RAM and instructions of a frame, predicted.
//!
//! A frame of `n` elements and `k` lights with tables kept takes `n (a + b k)` instructions by the kernel that reads the atlas's
//! codes ([`relume::relight::full`], or [`relume::relight::full_any`]); where its table does not fit into the
//! 16 KiB of a small core, [`relume::relight::Sums`] adds up light by light and fills a table for each. The constants are
//! fitted to what `tests/firmware` counts; `tests/firmware.rs` holds them to 10 %.

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

/// Predicted for one core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeviceCost {
    /// Bytes of flash: the atlas and the code that relights it.
    pub flash: u64,
    /// Bytes of RAM: tables, pixels and the stack.
    pub ram: u64,
    /// Instructions of a frame with tables kept, where there is room for them.
    pub frame: u64,
}

/// Bytes of RAM that a small core has for tables.
const SMALL_TABLE: u64 = 12 << 10;

impl DeviceCost {
    /// Of an atlas of so many bytes.
    #[must_use]
    pub fn new(atlas: &Atlas, bytes: usize, core: Core) -> Self {
        let (n, k) = (
            f64::from(atlas.element_count()),
            f64::from(atlas.light_count()),
        );
        let lights = u64::from(atlas.light_count());
        let is_lum = atlas.is_all_in(|code| code == Code::Lum8);
        let is_colour = atlas.is_all_in(|code| code.bytes() == 3);
        let elements = u64::from(atlas.element_count());
        let (model, table) = if is_lum && (core != Core::M0 || 1024 * lights <= SMALL_TABLE) {
            (with_tables(core, true), 1024 * lights)
        } else if is_lum {
            (LUM_IN_BATCHES, 1024 + 4 * elements)
        } else if is_colour {
            (with_tables(core, false), 1536 * lights)
        } else {
            (any(core), 2 * table_length(atlas) as u64 + 6 * elements)
        };
        Self {
            flash: bytes as u64 + model.code,
            ram: table + 2 * elements + model.stack,
            frame: (n * (model.element + model.code_of_light * k) + model.light * k) as u64,
        }
    }
}

/// Constants of a kernel on a core.
struct Model {
    /// Instructions per element.
    element: f64,
    /// Instructions per element and light.
    code_of_light: f64,
    /// Instructions per light.
    light: f64,
    /// Bytes of code and constants.
    code: u64,
    /// Bytes of stack.
    stack: u64,
}

/// A table of every light, of luminance or of three channels.
const fn with_tables(core: Core, is_lum: bool) -> Model {
    let (element, code_of_light, code) = match (core, is_lum) {
        (Core::M0, true) => (32.0, 5.0, 13_500),
        (_, true) => (21.5, 3.41, 20_300),
        (Core::M0, false) => (27.5, 16.1, 21_700),
        (_, false) => (17.4, 11.05, 35_800),
    };
    Model {
        element,
        code_of_light,
        light: 0.0,
        code,
        stack: 2_000,
    }
}

/// On the M0, a table filled for every light of every frame.
const LUM_IN_BATCHES: Model = Model {
    element: 27.0,
    code_of_light: 7.25,
    light: 11_000.0,
    code: 16_000,
    stack: 2_500,
};

const fn any(core: Core) -> Model {
    let (code_of_light, code) = match core {
        Core::M0 => (900.0, 35_500),
        _ => (509.0, 35_500),
    };
    Model {
        element: 25.0,
        code_of_light,
        light: 0.0,
        code,
        stack: 6_400,
    }
}
