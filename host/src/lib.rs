//! Import, baking, references, pictures and the command line of Relume.
//!
//! Modules in the order in which data flows through them; each names only those above it.

pub mod file;

pub mod noise;

pub mod linear;

pub mod texture;

pub mod scene;

pub mod builtin;

pub mod import;

pub mod bvh;

pub mod mesh;

pub mod solution;

pub mod rows;

pub mod gather;

pub mod bake;

pub mod picture;

pub mod display_error;

pub mod pack;

pub mod mix;

pub mod probe;

pub mod device_cost;

pub mod export;

pub mod preview;

pub mod polygon_pair;

pub mod reference;

pub mod chart;

pub mod study;

pub mod cli;
