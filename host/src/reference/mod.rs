//! Answers that were found another way: closed forms, a dense solution, a path tracer.
//!
//! Everything here is `f64` with mathematics of its own and shares no transport code with what it
//! checks; of the solver it reads plain data only (vertices, reflectances, emissions), which
//! `tests/layers.rs` holds.
//!
//! * [`closed_form`] knows form factors and irradiances that have a formula;
//! * [`dense`] solves a given patch system directly, so it judges the refinement and nothing else;
//! * [`path_trace`] knows nothing of patches at all and judges the whole, with standard errors.

pub mod closed_form;

pub mod dense;

pub mod path_trace;
