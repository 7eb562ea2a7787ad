//! All tests.
//!
//! A new test goes into the module whose truth it checks:
//! - `agree`: compute and cpu draw the same picture; a spoiled copy is caught.
//! - `architecture`: registry, contracts, who imports whom, where unsafe code may be.
//! - `cli`: the real binary in a temporary folder: outputs, exact errors, exit codes.
//! - `closed_form`: pictures and paths whose answer is known.
//! - `corners`: rays through edges and vertices, along faces, starting on faces.
//! - `curves`: chords, exits, logarithms and area densities against walks along the flow.
//! - `geodesic`: errors of end points against a reference of 192 bits.
//! - `gluing`: gluing files and Dirichlet domains.
//! - `gltf`, `scene`: what is read, and what is refused with which words.
//! - `laws`: what every geometry must satisfy.
//! - `plan`: what scenes leave out; no device.
//! - `polyhedra`, `spaces`: cells, the catalogue, and the proof that a gluing closes, against reference data.
//! - `shaders`: layout of shared structures in the compiled modules.
//! - `transport`: geodesics through the faces against the unfolded ones.
//! - `twins`: each function of the shaders' geometries against its Rust twin, on the device.
//! - `vulkan`: devices, probe, compute backend, faults, and that validation is silent.
//!
//! `support` holds what modules share, `big` numbers of 192 bits. Tests of a device take it through `support::gpu`.

mod agree;
mod architecture;
mod big;
mod cli;
mod closed_form;
mod corners;
mod curves;
mod geodesic;
mod gltf;
mod gluing;
mod laws;
mod plan;
mod polyhedra;
mod scene;
mod shaders;
mod spaces;
mod support;
mod transport;
mod twins;
mod vulkan;
