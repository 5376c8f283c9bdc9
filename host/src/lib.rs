//! Import, baking, references, pictures and the command line of Relume.
//!
//! Modules in the order in which data flows through them.

pub mod texture;

pub mod scene;

pub mod builtin;

pub mod import;

pub mod export;

pub mod picture;

pub mod preview;

pub mod reference;
