//! Time and memory of a bake over the number of its elements, patches growing with them.
//!
//! One large scene is divided ever more finely and baked at default settings, on one thread, so that
//! seconds are work. Elements gather by rays, as many from each whatever their number, and lamps are as many
//! as before, so time should grow with the elements; what grows slower are the parts of the scene that
//! are searched for light, and what patches share. *Memory* is the most that the process has held at once while
//! it baked (`VmHWM` of `/proc`, which only Linux has).

use std::fs;
use std::ops::ControlFlow;
use std::time::Instant;

use anyhow::Result;
use rayon::ThreadPoolBuilder;

use crate::bake::{Meshed, Settings};
use crate::chart::{Chart, Series, Style, Vertical};
use crate::scene::OwnedScene;

/// One division of the scene.
#[derive(Clone, Debug)]
pub struct Size {
    /// Longest edge of an element, in the scene's units.
    pub element: f32,
    /// Elements.
    pub elements: usize,
    /// Patches.
    pub patches: usize,
    /// Seconds to find the faces that light reaches and to divide them.
    pub meshing: f64,
    /// Seconds to solve.
    pub solving: f64,
    /// Most bytes held at once, where the system tells.
    pub memory: Option<u64>,
    /// Estimated relative L1 error of the worst light.
    pub error: f64,
}

impl Size {
    /// Milliseconds per element.
    #[must_use]
    pub fn milliseconds(&self) -> f64 {
        1e3 * (self.meshing + self.solving) / self.elements as f64
    }
}

/// Bakes a scene with elements of several lengths, the longest first; `watch` is told of each one.
///
/// # Errors
/// A scene that is not fit to be baked, or a thread that cannot be started.
pub fn measure(
    scene: &OwnedScene,
    lengths: &[f32],
    mut watch: impl FnMut(&Size) + Send,
) -> Result<Vec<Size>> {
    let one_thread = ThreadPoolBuilder::new().num_threads(1).build()?;
    one_thread.install(|| {
        let mut sizes = Vec::new();
        for length in lengths {
            let size = bake(scene, *length)?;
            watch(&size);
            sizes.push(size);
        }
        Ok(sizes)
    })
}

fn bake(scene: &OwnedScene, element: f32) -> Result<Size> {
    let mut go_on = |_| ControlFlow::Continue(());
    forget_most_memory();
    let start = Instant::now();
    let meshed = Meshed::new(scene, None, Some(element), &mut go_on)?;
    let meshing = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let (solution, _) = meshed.solve(&Settings::default(), &mut go_on)?;
    let errors = solution.lights.iter().map(|light| light.error);
    Ok(Size {
        element,
        elements: meshed.mesh().elements.len(),
        patches: meshed.mesh().patches.len(),
        meshing,
        solving: start.elapsed().as_secs_f64(),
        memory: most_memory(),
        error: errors.fold(0.0, f32::max).into(),
    })
}

/// From here on the most memory is counted anew; where that cannot be done, nothing is told later.
fn forget_most_memory() {
    let _ = fs::write("/proc/self/clear_refs", "5");
}

/// The most memory that was held at once, bytes.
fn most_memory() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kilobytes * 1024)
}

/// Charts, with the names of their files.
#[must_use]
pub fn charts(sizes: &[Size]) -> [(&'static str, Chart); 2] {
    let series = |name: &str, value: fn(&Size) -> f64| {
        let point = |size: &Size| (size.elements as f64, value(size));
        Series::new(name, Style::Curve, sizes.iter().map(point))
    };
    let chart = |title: &str, y: &str, series| Chart {
        title: title.to_owned(),
        x: "number of elements".to_owned(),
        y: Vertical::Values(y.to_owned()),
        series,
    };
    let per_element = vec![
        series("whole bake", Size::milliseconds),
        series("meshing", |size| 1e3 * size.meshing / size.elements as f64),
        series("solving", |size| 1e3 * size.solving / size.elements as f64),
    ];
    let memory = series("whole process", |size| {
        size.memory
            .map_or(0.0, |bytes| bytes as f64 / f64::from(1 << 20))
    });
    [
        (
            "scale_time.svg",
            chart(
                "time per element",
                "time per element on one thread (ms)",
                per_element,
            ),
        ),
        (
            "scale_memory.svg",
            chart("memory", "most memory at once (MiB)", vec![memory]),
        ),
    ]
}
