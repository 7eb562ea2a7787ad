//! The real binary in temporary folders: what it writes, the exact lines with which it refuses, and its exit codes.
//!
//! A new test goes into the part that its command or its refusal belongs to; `program` runs the binary and holds the
//! checks that all parts share, with the tests that these checks can fail.

mod geodesic;
mod options;
mod pictures;
mod profile;
mod program;
mod reports;
mod scenes;
mod sequences;
mod streams;
mod transport;
mod vulkan;
