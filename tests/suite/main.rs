//! All tests.
//!
//! A new test goes into the module whose truth it checks:
//! - `spaces`: the catalogue, polyhedra and the proof that a gluing closes, against reference data.
mod spaces;
