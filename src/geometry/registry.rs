//! The one place where a geometry is registered.
//!
//! Each line names a Rust module `src/geometry/<module>.rs` with a unit type that implements
//! [`Geometry`](super::Geometry), and with it the GLSL twin `shaders/geometry/<module>.glsl`. The build
//! script includes this file by path, so the shader variants, the parser, the help texts, the tests and the
//! benches all follow from the same lines.

/// Hands the list of geometries to the macro `$use_by`: `(Type, module, name, aliases, title)` for each.
macro_rules! geometries {
    ($use_by:ident) => {
        $use_by! {
            (E3, e3, "e3", ["euclidean"], "Euclidean space"),
            (S3, s3, "s3", ["spherical"], "the three-sphere"),
            (H3, h3, "h3", ["hyperbolic"], "hyperbolic space"),
            (S2xR, s2xr, "s2xr", ["sphere-line"], "the sphere times a line"),
            (H2xR, h2xr, "h2xr", ["plane-line"], "the hyperbolic plane times a line"),
            (Nil, nil, "nil", ["heisenberg"], "Nil, the Heisenberg group"),
            (Sol, sol, "sol", ["solv"], "Sol"),
            (Sl2, sl2, "sl2", ["sl2r"], "the universal cover of SL(2, R)"),
            (Sl2Trace, sl2_trace, "sl2-trace", ["sl2-book"], "SL(2, R) with the Lorentzian trace form"),
        }
    };
}
pub(crate) use geometries;
