//! Makes the meshes of `scenes/meshes/` by procedure: `cargo run --release --example meshes -- DIR`.
//!
//! Organic shapes are signed fields; their zero sets are extracted with surface nets, relaxed,
//! unwrapped, and written as glTF 2.0 binaries whose textures are baked from colour functions of
//! the surface point. No clock, no randomness and no hashing: every run writes the same bytes.

mod field;
mod glb;
mod hands;
mod head;
mod plain;
mod surface;

use field::Res;
use std::path::Path;

fn main() -> Res<()> {
    let dir = std::env::args_os().nth(1).ok_or("usage: meshes DIR")?;
    let dir = Path::new(&dir);
    std::fs::create_dir_all(dir)?;
    head::head(dir)?;
    hands::hands(dir)?;
    plain::knot(dir, "knot", 784, 64)?;
    plain::knot(dir, "knot-small", 63, 8)?;
    plain::ring(dir, "ring", 64, 8)?;
    plain::ring(dir, "ring-fine", 640, 80)?;
    plain::leaf(dir)
}
