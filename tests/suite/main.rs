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
//! - `deck`: elements of deck groups in whole numbers, against the groups themselves.
//! - `geodesic`: errors of end points against a reference of 192 bits.
//! - `gluing`: gluing files and Dirichlet domains.
//! - `gltf`, `scene`: what is read, and what is refused with which words.
//! - `heatmap`: pictures of what pixels cost, whose sums are the work counters.
//! - `hits`: hits on curved geodesics, and balls and tubes as triangles, in geometries made for the purpose.
//! - `integrate`: the order of each integrator, its passages through faces, its ends, its pictures.
//! - `laws`: what every geometry must satisfy.
//! - `lights`: each place lists all images of lights that shine there.
//! - `measure`: the reference arithmetic, FLIP, tables and plots, and the report of `accuracy`.
//! - `observer`: walks through the faces, what closed loops pick up, camera paths.
//! - `plan`: what scenes leave out; no device.
//! - `polyhedra`, `spaces`: cells, the catalogue, and the proof that a gluing closes, against reference data.
//! - `reference`: the numbers of 192 bits that errors are measured against.
//! - `rt`: acceleration structures, moving objects, the pipeline cache, faults of the ray tracing backend.
//! - `shaders`: layout of shared structures in the compiled modules.
//! - `stability`: the list of stiff and extreme cases passes, is complete, and a spoiled result is caught.
//! - `transport`: geodesics through the faces against the unfolded ones.
//! - `twins`: each function of the shaders' geometries against its Rust twin, on the device.
//! - `vulkan`: devices, probe, compute backend, faults, and that validation is silent.
//! - `xr`: sessions with a headset, played by a runtime that is a few lines of code; `monado`: the same on a real one.
//!
//! `support` holds what modules share. Geodesic flows in 192 bits are in `holonomy::measure::reference`.
//! Tests of a device take it through `support::gpu` or `support::rt_gpu`.

mod agree;
mod architecture;
mod body;
mod cli;
mod closed_form;
mod corners;
mod curved;
mod curves;
mod deck;
mod geodesic;
mod gltf;
mod gluing;
mod heatmap;
mod hits;
mod integrate;
mod laws;
mod lights;
mod measure;
#[cfg(unix)]
mod monado;
mod observer;
mod plan;
mod polyhedra;
mod reference;
mod rt;
mod scene;
mod shaders;
mod spaces;
mod stability;
mod support;
mod transport;
mod twins;
mod vulkan;
mod xr;
