//! All tests.
//!
//! A new test goes into the module whose truth it checks:
//! - `gluing`: files, round trips, refusals.
//! - `laws`: what every geometry promises; a new geometry is one more name in its macro line.
//! - `polyhedra`: corners, edges and outlines of cells.
//! - `spaces`: the catalogue and the proof that a gluing closes, against reference data.

mod gluing;
mod laws;
mod polyhedra;
mod spaces;
