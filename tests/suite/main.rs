//! All tests.
//!
//! A new test goes into the module whose truth it checks:
//! - `gluing`: files, round trips, refusals.
//! - `polyhedra`: corners, edges and outlines of cells.
//! - `spaces`: the catalogue and the proof that a gluing closes, against reference data.

mod gluing;
mod polyhedra;
mod spaces;
