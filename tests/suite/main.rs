//! All tests.

/// Meshes: what is read, and what is refused with which words. A new case of a malformed file goes here.
mod gltf;
/// Scene files: the exact text of every refusal, paths, and the shipped scenes.
mod scene;
