//! Studies: published methods beside ours, measured in one run of the same code.

pub mod hemicube;
pub mod paper;
pub mod ray_rows;
pub mod shooting;
pub mod stability;
pub mod system;
