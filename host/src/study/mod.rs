//! Studies: published methods beside ours, what they cost and how exact they are, measured in one run.
//!
//! A naive method is a published one, by name, and goes through the same code as ours; where that has no
//! use for it, it lives here.

pub mod accuracy;
pub mod estimates;
pub mod hemicube;
pub mod paper;
pub mod quantization;
pub mod ray_rows;
pub mod scale;
pub mod shooting;
pub mod stability;
pub mod system;
pub mod truth;

/// A built-in scene, divided for a test.
#[cfg(test)]
fn meshed(builtin: &crate::builtin::Builtin, patch: f32, element: f32) -> crate::bake::Meshed<'_> {
    let mut go_on = |_| std::ops::ControlFlow::Continue(());
    crate::bake::Meshed::new(&builtin.scene, Some(patch), Some(element), &mut go_on).unwrap()
}
