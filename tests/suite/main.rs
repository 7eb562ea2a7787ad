//! All tests.
//!
//! A new test goes into the module whose truth it checks:
//! - `polyhedra`: corners, edges and outlines of cells.
//! - `spaces`: the catalogue and the proof that a gluing closes, against reference data.
//! - `vulkan`: devices, probe, compute backend, faults, and that validation is silent.
//!
//! `support` holds what modules share. Tests of a device take it through `support::gpu`.

mod polyhedra;
mod spaces;
mod support;
mod vulkan;
