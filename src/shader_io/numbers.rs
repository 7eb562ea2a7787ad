//! Named numbers that host and shaders both know.

use super::types;

/// Declares named numbers for both sides.
macro_rules! numbers {
    ($($(#[doc = $doc:literal])* $name:ident: $type:ident = $value:expr;)*) => {
        $($(#[doc = $doc])* pub const $name: types::$type = $value;)*

        /// GLSL declarations of all named numbers.
        pub fn numbers_glsl() -> String {
            let mut text = String::new();
            $(text += &format!("const {} IO_{} = {};\n", stringify!($type), stringify!($name), Literal::glsl($name));)*
            text
        }
    };
}

trait Literal {
    fn glsl(self) -> String;
}

impl Literal for u32 {
    fn glsl(self) -> String {
        format!("{self}u")
    }
}

impl Literal for f32 {
    fn glsl(self) -> String {
        format!("{self:e}")
    }
}

numbers! {
    /// "No such index".
    NONE: uint = 0xffff_ffff;
    /// A reference within a hierarchy is an index and, from this bit on, what is there: 0, 1 or 2 for a node, the axis along
    /// which its children are sorted, or one of the following.
    REFERENCE_SHIFT: uint = 28;
    /// Bit of a reference that none to a node has, and all others.
    REFERENCE_END_BIT: uint = REFERENCE_SHIFT + 2;
    /// Nothing is there. Its box is one point, which rays may pass through.
    REFERENCE_NOTHING: uint = 4;
    /// A triangle is there.
    REFERENCE_TRIANGLE: uint = 5;
    /// A quadric is there.
    REFERENCE_QUADRIC: uint = 6;
    /// Among the arrays that are read by address: the nodes.
    ARRAY_NODES: uint = 0;
    /// The triangles.
    ARRAY_TRIANGLES: uint = 1;
    /// The quadrics.
    ARRAY_QUADRICS: uint = 2;
    /// Their shading data.
    ARRAY_QUADRIC_SHADING: uint = 3;
    /// The guards.
    ARRAY_GUARDS: uint = 4;
    /// How many such arrays there are.
    ARRAYS: uint = 5;
    /// Most guards, of all kinds together.
    GUARDS: uint = 32;
    /// Kind of an instance, a bit of its mask: meshes that rest.
    KIND_MESHES: uint = 1;
    /// Kind of an instance, a bit of its mask: quadrics that rest.
    KIND_QUADRICS: uint = 2;
    /// Kind of an instance, a bit of its mask: what moves.
    KIND_MOVING: uint = 4;
    /// All kinds.
    KIND_ALL: uint = 7;
    /// Texture wrap mode.
    WRAP_REPEAT: uint = 0;
    /// Texture wrap mode.
    WRAP_CLAMP: uint = 1;
    /// Texture wrap mode.
    WRAP_MIRROR: uint = 2;
    /// Most faces of an only cell whose tests are unrolled: dodecahedra have 12, and code grows with each.
    UNROLLED_FACES: uint = 16;
    /// Lines of the grid of a hierarchy's boxes along an axis.
    LINES: uint = 65536;
    /// Voxels of a cell along an axis, on the finest level; each further level has half as many.
    VOXELS: uint = 64;
    /// Levels of voxels.
    VOXEL_LEVELS: uint = 5;
    /// Depth of the traversal stack. The builder keeps trees below it.
    STACK_SIZE: uint = 96;
    /// Passages that reduction may take after a crossing before it gives up; a state that needs more has left
    /// every chart of the group and is counted as lost.
    REDUCE_LIMIT: uint = 64;
    /// f32 counterpart of `geometry::ON_FACE`: a few roundings of coordinates of order 1.
    ON_FACE: float = 2e-6;
    /// f32 counterpart of `geometry::ALONG_FACE`.
    ALONG_FACE: float = 1e-6;
    /// Shadow rays start this far along the surface normal, and end as far before the light, in units of length.
    SHADOW_OFFSET: float = 5e-4;
    /// Segments reach this far beyond both ends, in chart units, so that a surface that passes through a face is
    /// met by the segment before the face or by the one behind it whatever the rounding.
    OVERLAP: float = 4e-6;
    /// Boxes for a device's traversal are larger than what is in them by this, in units of their coordinates and of the
    /// chart: the rounding of f32.
    BOX_SLACK: float = 4e-6;
    /// f32 counterpart of the cpu backend's slack at the edges of triangles that arcs meet, in units of the coordinates.
    ON_EDGE: float = 5e-7;
    /// Most pieces of an arc that a device's own traversal gets.
    PIECES: uint = 256;
    /// What is so near to the end of a piece counts as in it, as a share of the piece: the rounding of f32.
    BETWEEN_PIECES: float = 1e-5;
    /// A curve that leaves a cell and comes back within one arc, no farther outside than this many times what the arc may
    /// deviate, has not left. (Chart and metric differ by less than that in a cell.)
    FACE_MARGIN: float = 8.0;
    /// Length of the longest arc, and of a segment in an unbounded cell where the curve parameter does not reach the
    /// path's end.
    STRIDE: float = 2.0;
    /// A path's segment ends where the path ends.
    END_LIMIT: uint = 0xffff_ffff;
    /// A path's segment is an arc that ends inside the cell.
    END_ARC: uint = 0xffff_fffe;
    /// Face passages of a shadow ray after which its light counts as reached.
    SHADOW_BOUNCES: uint = 64;
    /// Light falls off as if it came from no nearer than this, so that a light at a surface stays finite.
    MIN_LIGHT_AREA: float = 1e-4;
    /// Fog times distance beyond which nothing is looked for: less than 1/8000 of what is there would be left of it, half a
    /// step of the darkest of 256 shades.
    FOG_HIDES: float = 9.0;
    /// Segments per permitted bounce after which a path is given up: arcs of curved geodesics are counted.
    SEGMENTS_PER_BOUNCE: uint = 4096;
    /// Pixels across one workgroup.
    GROUP_WIDTH: uint = 8;
    /// Pixels down one workgroup.
    GROUP_HEIGHT: uint = 8;
    /// Invocations of one workgroup that places triangles.
    PLACE_GROUP: uint = 64;
    /// Rays across a launch of listed rays, so that their number is not limited by what fits side by side.
    LIST_WIDTH: uint = 4096;
    /// Bits of a column, and of a row, in a listed ray; the eye is in the bits above.
    LIST_BITS: uint = 15;
    /// Side of the squares of pixels that share a ray rate.
    RATE_TILE: uint = 8;
    /// Image format: 8 bits, sRGB, red first.
    ENCODING_RGBA8_SRGB: uint = 0;
    /// Image format: 8 bits, sRGB, blue first.
    ENCODING_BGRA8_SRGB: uint = 1;
    /// Image format: 8 bits, linear, red first.
    ENCODING_RGBA8: uint = 2;
    /// Image format: 8 bits, linear, blue first.
    ENCODING_BGRA8: uint = 3;
    /// Image format: half floats, linear.
    ENCODING_RGBA16F: uint = 4;
    /// Image format: 16 bits, linear.
    ENCODING_RGBA16: uint = 5;
    /// Invocations of one workgroup of the probe.
    PROBE_GROUP: uint = 64;

    /// Riemannian shading.
    SHADING_RIEMANNIAN: uint = 0;
    /// Normals as colours.
    SHADING_NORMALS: uint = 1;
    /// Geodesic length to the first hit.
    SHADING_DISTANCE: uint = 2;
    /// Passages through faces.
    SHADING_BOUNCES: uint = 3;
    /// Segments traced.
    SHADING_SEGMENTS: uint = 4;
    /// Deck element of the cell in which the ray ended.
    SHADING_CELL: uint = 5;
    /// Object hit.
    SHADING_OBJECT: uint = 6;

    /// Counter: primary rays.
    COUNT_RAYS: uint = 0;
    /// Counter: segments of primary rays.
    COUNT_SEGMENTS: uint = 1;
    /// Counter: passages of primary rays through faces.
    COUNT_BOUNCES: uint = 2;
    /// Counter: primary rays that hit an object.
    COUNT_HITS: uint = 3;
    /// Counter: hierarchy nodes visited, shadow rays included.
    COUNT_NODES: uint = 4;
    /// Counter: triangles tested.
    COUNT_TRIANGLES: uint = 5;
    /// Counter: quadrics tested.
    COUNT_QUADRICS: uint = 6;
    /// Counter: shadow rays.
    COUNT_SHADOW_RAYS: uint = 7;
    /// Counter: segments of shadow rays.
    COUNT_SHADOW_SEGMENTS: uint = 8;
    /// Counter: states that reduction could not bring back into the domain. Always 0 in a sound space.
    COUNT_LOST: uint = 9;
    /// Number of counters.
    COUNT_END: uint = 10;

    /// Probe: `geo_flow`.
    PROBE_FLOW: uint = 0;
    /// Probe: `geo_inner`.
    PROBE_INNER: uint = 1;
    /// Probe: `geo_log`.
    PROBE_LOG: uint = 2;
    /// Probe: `geo_area_density`.
    PROBE_AREA_DENSITY: uint = 3;
    /// Probe: `geo_length`.
    PROBE_LENGTH: uint = 4;
    /// Probe: `geo_parameter_at`.
    PROBE_PARAMETER_AT: uint = 5;
    /// Probe: `geo_advance`.
    PROBE_ADVANCE: uint = 6;
    /// Probe: `geo_exit`.
    PROBE_EXIT: uint = 7;
    /// Probe: `geo_arc`.
    PROBE_ARC: uint = 8;
    /// Probe: `geo_parameter`.
    PROBE_PARAMETER: uint = 9;
    /// Probe: `geo_restore`.
    PROBE_RESTORE: uint = 10;
    /// Probe: `geo_chart`.
    PROBE_CHART: uint = 11;
    /// Probe: `geo_unchart`.
    PROBE_UNCHART: uint = 12;
    /// Probe: `geo_raise`.
    PROBE_RAISE: uint = 13;
    /// Probe: `geo_apply`, with the pairing of the first face.
    PROBE_APPLY: uint = 14;
    /// Probe: `geo_side`.
    PROBE_SIDE: uint = 16;
    /// Probe: `geo_closeness`.
    PROBE_CLOSENESS: uint = 17;
    /// Probe: `geo_cross`, with `c` for the plane and the first face's linear part and shift for the folded pairing.
    PROBE_CROSS: uint = 18;
    /// Probe: `geo_base`.
    PROBE_BASE: uint = 15;
    /// Probe: `geo_lower`.
    PROBE_LOWER: uint = 19;
    /// Probe: `geo_chart_vector`.
    PROBE_CHART_VECTOR: uint = 20;
    /// Probe: `geo_unchart_vector`.
    PROBE_UNCHART_VECTOR: uint = 21;
    /// Probe: `geo_spray`.
    PROBE_SPRAY: uint = 22;
    /// Probe: `integrate_step` of length `t` with the method in `c.x`, at the share `c.y`.
    PROBE_STEP: uint = 23;
    /// Probe: `integrate_follow` for length `t` with the method in `c.x` and its parameter in `c.y`.
    PROBE_FOLLOW: uint = 24;

    /// Integrator: the geometry's own flow.
    INTEGRATOR_EXACT: uint = 0;
    /// Integrator: Euler's method.
    INTEGRATOR_EULER: uint = 1;
    /// Integrator: Runge and Kutta's method of order 4.
    INTEGRATOR_RK4: uint = 2;
    /// Integrator: Dormand and Prince's method of order 5.
    INTEGRATOR_DOPRI5: uint = 3;
    /// Most steps of one geodesic of the probe.
    INTEGRATE_STEPS: uint = 1_000_000;
}
