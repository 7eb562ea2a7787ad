//! All tests.
//!
//! A new test goes into the module whose truth it checks:
//! - `agree`: compute and cpu draw the same picture; a spoiled copy is caught.
//! - `architecture`: registry, contracts, who imports whom, where unsafe code may be.
//! - `body`: head, hands and eyes of a player: rigid, picking up holonomy, seeing in depth.
//! - `cli`: the real binary in a temporary folder: outputs, exact errors, exit codes.
//! - `closed_form`: pictures and paths whose answer is known.
//! - `curved`: arcs, exits, nearest points, logarithms and series of the geometries with curved geodesics.
//! - `corners`: rays through edges and vertices, along faces, starting on faces.
//! - `curves`: arcs, exits, logarithms and area densities against walks along the flow.
//! - `geodesic`: errors of end points against a reference of 192 bits.
//! - `gluing`: gluing files and Dirichlet domains.
//! - `gltf`, `scene`: what is read, and what is refused with which words.
//! - `hits`: hits on curved geodesics, and balls and tubes as triangles, in geometries made for the purpose.
//! - `laws`: what every geometry must satisfy.
//! - `observer`: walks through the faces, what closed loops pick up, camera paths.
//! - `plan`: what scenes leave out; no device.
//! - `polyhedra`, `spaces`: cells, the catalogue, and the proof that a gluing closes, against reference data.
//! - `rt`: acceleration structures, moving objects, the pipeline cache, faults of the ray tracing backend.
//! - `shaders`: layout of shared structures in the compiled modules.
//! - `transport`: geodesics through the faces against the unfolded ones.
//! - `twins`: each function of the shaders' geometries against its Rust twin, on the device.
//! - `vulkan`: devices, probe, compute backend, faults, and that validation is silent.
//! - `xr`: sessions with a headset, played by a runtime that is a few lines of code; `monado`: the same on a real one.
//!
//! `support` holds what modules share, `big` numbers of 192 bits and, with `big_groups`, the geodesic flows in them.
//! Tests of a device take it through `support::gpu` or `support::rt_gpu`.

mod agree;
mod architecture;
mod big;
mod big_groups;
mod body;
mod cli;
mod closed_form;
mod corners;
mod curved;
mod curves;
mod geodesic;
mod gltf;
mod gluing;
mod hits;
mod laws;
#[cfg(unix)]
mod monado;
mod observer;
mod plan;
mod polyhedra;
mod rt;
mod scene;
mod shaders;
mod spaces;
mod support;
mod transport;
mod twins;
mod vulkan;
mod xr;
