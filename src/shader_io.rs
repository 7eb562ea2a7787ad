//! Everything that host and shaders both know: structures, bindings, specialization constants, named numbers.
//!
//! Each is written once, here or beside, by a macro that declares the Rust item and emits its GLSL text; the build script
//! includes this file by path and writes [`glsl`] to `shared/io.glsl` on the shader include path. All buffers
//! use scalar block layout (`VK_EXT_scalar_block_layout`, core in Vulkan 1.2), so a `vec3` is three floats on
//! both sides; the test `shaders::layout` compares every offset with the compiled SPIR-V. In what rays read, vectors lie on
//! multiples of 16 bytes all the same: hardware gets such a one in one piece.

// The build script includes this file by path, so the place is not found by the name alone.
#[path = "shader_io/numbers.rs"]
mod numbers;

pub use numbers::*;

/// GLSL type names, so that the structures below read the same in both languages.
#[allow(non_camel_case_types)]
pub mod types {
    /// 32-bit float.
    pub type float = f32;
    /// 32-bit unsigned integer.
    pub type uint = u32;
    /// Two floats.
    pub type vec2 = [f32; 2];
    /// Three floats.
    pub type vec3 = [f32; 3];
    /// Four floats.
    pub type vec4 = [f32; 4];
    /// Two unsigned integers.
    pub type uvec2 = [u32; 2];
    /// Three unsigned integers.
    pub type uvec3 = [u32; 3];
    /// Four unsigned integers.
    pub type uvec4 = [u32; 4];
    /// Four columns of four floats.
    pub type mat4 = [[f32; 4]; 4];
}

/// Declares `repr(C)` structures and collects their GLSL text, names, members and offsets.
macro_rules! structures {
    ($($(#[doc = $doc:literal])* struct $name:ident { $($(#[doc = $field_doc:literal])* $field:ident: $type:ident,)* })*) => {
        $(
            $(#[doc = $doc])*
            #[repr(C)]
            #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
            pub struct $name { $($(#[doc = $field_doc])* pub $field: types::$type,)* }
        )*

        /// GLSL declarations of all structures.
        pub const STRUCTURES_GLSL: &str = concat!(
            $("struct ", stringify!($name), " {\n", $("    ", stringify!($type), " ", stringify!($field), ";\n",)* "};\n",)*
        );

        /// Name, members and byte offsets of all structures, for the layout test.
        pub fn layouts() -> Vec<(&'static str, usize, Vec<(&'static str, usize)>)> {
            vec![$((
                stringify!($name),
                std::mem::size_of::<$name>(),
                vec![$((stringify!($field), std::mem::offset_of!($name, $field)),)*],
            ),)*]
        }
    };
}

structures! {
    /// What changes from picture to picture: an eye and the render settings. Where two eyes are drawn at once, the
    /// settings are the same in both views.
    struct View {
        /// Eye position, in the model.
        eye: vec4,
        /// Unit tangent vector to the right.
        right: vec4,
        /// Unit tangent vector upwards.
        up: vec4,
        /// Unit tangent vector forwards.
        forward: vec4,
        /// Tangents of the frustum's sides from the view direction: left, right, down, up (left and down are
        /// negative in a symmetric frustum).
        tangents: vec4,
        /// Colour where nothing is seen, linear.
        background: vec3,
        /// Fog density per unit length.
        fog: float,
        /// Light from everywhere, linear.
        ambient: vec3,
        /// Geodesics end here.
        max_distance: float,
        /// Colour times intensity of the light at the viewer, linear.
        headlight: vec3,
        /// Largest deviation of an arc from its geodesic, as an angle seen from the eye.
        tolerance: float,
        /// Largest way from the chord of a piece of an arc to the arc, in chart units, where a device's own traversal gets it.
        sagitta: float,
        /// Width and height in pixels.
        size: uvec2,
        /// Largest number of face passages.
        bounces: uint,
        /// Cell in which the eye is.
        cell: uint,
        /// Step or tolerance of the integrator.
        integration: float,
    }

    /// What changes from dispatch to dispatch: push constants.
    struct Dispatch {
        /// First pixel of the tile.
        origin: uvec2,
        /// Pixels of the tile.
        extent: uvec2,
        /// Position of the sample inside a pixel, in [0, 1)².
        offset: vec2,
        /// First of the eyes that are drawn; invocations count on from it.
        eye: uint,
    }

    /// How pixels of eyes become an image: push constants.
    struct Resolve {
        /// Width and height of an eye in pixels.
        size: uvec2,
        /// One of the `ENCODING_` numbers.
        encoding: uint,
        /// 1 if not all pixels have a ray.
        sparse: uint,
        /// Metres in a unit of length; 0 if no depth is wanted.
        unit: float,
        /// Distance of the near plane in metres, where the depth is 0.
        near: float,
    }

    /// What placing a copy of a moving mesh needs: push constants.
    struct Placement {
        /// Linear part of the isometry from the rest to the copy.
        linear: mat4,
        /// Rest of the isometry.
        shift: vec4,
        /// First vertex of the mesh at rest.
        first_vertex: uint,
        /// First corner of the mesh at rest.
        first_corner: uint,
        /// First triangle of the copy.
        first_triangle: uint,
        /// Number of triangles.
        count: uint,
        /// Boxes about its triangles reach this far beyond them.
        margin: float,
    }

    /// A vertex of a mesh at rest.
    struct RestVertex {
        /// The point, in the model.
        point: vec4,
        /// Unit normal, a tangent vector there.
        normal: vec4,
    }

    /// A face of a cell with its pairing.
    struct Face {
        /// Inner side is `plane · (chart, 1) ≤ 0`.
        plane: vec4,
        /// Linear part of the pairing, folded as `geo_cross` wants it.
        linear: mat4,
        /// Rest of the folded pairing.
        shift: vec4,
        /// Cell on the other side.
        cell: uint,
        /// Unused.
        padding: uvec3,
    }

    /// A cell: ranges in the other buffers.
    struct Cell {
        /// Lower corner of the grid of the hierarchy's boxes, in the chart.
        grid_lower: vec3,
        /// Root of the cell's bounding volume hierarchy, or [`NONE`].
        root: uint,
        /// Grid lines per unit of the chart along each axis.
        grid_scale: vec3,
        /// First face.
        first_face: uint,
        /// Lower corner of the grid whose boxes list lights, in the chart.
        light_lower: vec3,
        /// Number of faces.
        face_count: uint,
        /// Boxes of that grid per unit of the chart along each axis.
        light_scale: vec3,
        /// Boxes along each axis.
        light_boxes: uint,
        /// Where the lists of the boxes begin in `light_lists`: of each box the place of its first image, and of the one
        /// behind the last.
        light_lists: uint,
        /// First word of the cell's voxels in `voxels`, or [`NONE`] if it has none.
        voxels: uint,
        /// Device address of the cell's acceleration structure.
        scene: uvec2,
    }

    /// Node of a hierarchy: the boxes of its four children on the cell's grid, a cache line.
    struct Node {
        /// Lower (low half) and upper (high half) grid line of each child's box along x.
        x: uvec4,
        /// The same along y.
        y: uvec4,
        /// The same along z.
        z: uvec4,
        /// References of the children, see [`REFERENCE_SHIFT`].
        children: uvec4,
    }

    /// Corners of a triangle, in the chart; for `compute` of a pair of triangles (a, b, c) and (c, b, d), where d is c if it has
    /// only one.
    struct Triangle {
        /// First corner.
        a: vec3,
        /// First coordinate of d.
        after_a: float,
        /// Second corner.
        b: vec3,
        /// Second coordinate of d.
        after_b: float,
        /// Third corner.
        c: vec3,
        /// Third coordinate of d.
        after_c: float,
    }

    /// What shading needs of a triangle.
    struct TriangleShading {
        /// Index of the material.
        material: uint,
        /// Index of the scene's object.
        object: uint,
        /// Chart conormal at the first corner.
        conormal_a: vec3,
        /// Chart conormal at the second corner.
        conormal_b: vec3,
        /// Chart conormal at the third corner.
        conormal_c: vec3,
        /// Texture coordinates at the first corner.
        uv_a: vec2,
        /// Texture coordinates at the second corner.
        uv_b: vec2,
        /// Texture coordinates at the third corner: behind the rest, as few scenes read them.
        uv_c: vec2,
    }

    /// A box about a primitive.
    struct Box {
        /// Its lower corner.
        lower: vec3,
        /// Its upper corner.
        upper: vec3,
    }

    /// A box about what rests in a cell, asked before a segment is traced.
    struct Guard {
        /// Its lower corner.
        lower: vec3,
        /// Its upper corner.
        upper: vec3,
        /// Device address of an acceleration structure of what is in it alone; 0 if it has none.
        scene: uvec2,
    }

    /// An arc that is traced, in pieces: a `Segment` of `shaders/stage/walk.glsl`.
    struct Arc {
        /// Where it begins, in the chart.
        origin: vec3,
        /// Its chord.
        direction: vec3,
        /// Its bend.
        bend: vec3,
        /// The piece that is traced.
        piece: float,
        /// Their number.
        pieces: float,
    }

    /// The surface `Σ (form · x)² = quadratic |chart|² + constant`, `x = (chart, 1)`.
    struct Quadric {
        /// First linear form.
        form0: vec4,
        /// Second linear form.
        form1: vec4,
        /// Third linear form; zero for a tube.
        form2: vec4,
        /// Coefficient of the chart point's square.
        quadratic: float,
        /// The rest.
        constant: float,
        /// Unused.
        padding: vec2,
    }

    /// What traversal needs of a quadric only where it is hit, and what shading needs.
    struct QuadricShading {
        /// Points with a negative product are cut off.
        clip0: vec4,
        /// Points with a negative product are cut off.
        clip1: vec4,
        /// Index of the material.
        material: uint,
        /// Index of the scene's object.
        object: uint,
        /// Unused.
        padding: uvec2,
    }

    /// A surface's looks: the metallic-roughness model of glTF 2.0.
    struct Material {
        /// Linear base colour and opacity.
        base_color: vec4,
        /// Linear light that the surface gives by itself.
        emission: vec3,
        /// 0 dielectric, 1 metal.
        metallic: float,
        /// Perceptual roughness.
        roughness: float,
        /// Opacity below which a texel is a hole; negative: no mask.
        alpha_cutoff: float,
        /// Index of the base colour texture, or [`NONE`].
        base_texture: uint,
        /// Index of the metallic-roughness texture (green roughness, blue metallic), or [`NONE`].
        surface_texture: uint,
        /// Colour from place: the base colour is multiplied with this times the chart coordinates ...
        coordinate_scale: vec3,
        /// ... plus this, within 0 and 1.
        coordinate_shift: vec3,
    }

    /// A texture in the texel buffer. Texels are linear RGBA as four halves, so that each backend filters the
    /// same numbers in the same way.
    struct Texture {
        /// First texel.
        first: uint,
        /// Width in texels.
        width: uint,
        /// Height in texels.
        height: uint,
        /// Wrap mode across: [`WRAP_REPEAT`], [`WRAP_CLAMP`] or [`WRAP_MIRROR`].
        wrap_u: uint,
        /// Wrap mode down.
        wrap_v: uint,
    }

    /// A point light, or the image of one under a deck transformation.
    struct Light {
        /// Position, in the model.
        point: vec4,
        /// Colour times intensity, linear.
        color: vec3,
        /// Its light fades to nothing at this distance.
        range: float,
        /// Axis of a spot light: unit tangent vector at its position.
        axis: vec4,
        /// The geometry's closeness of points at that distance.
        closest: float,
        /// Cosine of half the spot's opening angle; below −1: shines everywhere.
        spot_cosine: float,
        /// 1 if objects throw shadows in it.
        shadows: uint,
        /// Unused.
        padding: uint,
    }

    /// One evaluation of a function of the geometry, for tests and the `geodesic` command.
    struct ProbeIn {
        /// First argument.
        a: vec4,
        /// Second argument.
        b: vec4,
        /// Third argument.
        c: vec4,
        /// Scalar argument.
        t: float,
        /// Which function: one of the `PROBE_` numbers.
        op: uint,
    }

    /// A ray that meets nothing, between two pieces of its walk through the faces.
    struct Walk {
        /// Where it is, in the cell's coordinates.
        point: vec4,
        /// Unit tangent vector there.
        velocity: vec4,
        /// Geodesic length so far.
        travelled: float,
        /// The cell.
        cell: uint,
        /// Faces passed.
        bounces: uint,
        /// Segments begun.
        segments: uint,
        /// Deck element of the cell, or [`NONE`].
        label: uint,
        /// The piece ends when so many faces are passed.
        until: uint,
        /// 1 if no pairing brings it back into the domain, or no face ends it.
        lost: uint,
    }

    /// The result of a [`ProbeIn`].
    struct ProbeOut {
        /// First result.
        a: vec4,
        /// Second result.
        b: vec4,
    }
}

/// Declares specialization constants with the ids 0, 1, 2, … for both sides.
macro_rules! specialization {
    ($($(#[doc = $doc:literal])* $name:ident: $type:ident = $default:literal;)*) => {
        /// Values of the specialization constants, in the order of their ids; booleans are 0 or 1.
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        #[allow(non_snake_case)]
        pub struct Specialization { $($(#[doc = $doc])* pub $name: u32,)* }

        impl Specialization {
            /// The values as words; word `i` belongs to constant id `i`.
            pub fn words(&self) -> Vec<u32> {
                vec![$(self.$name),*]
            }
        }

        /// GLSL declarations of all specialization constants.
        pub fn specialization_glsl() -> String {
            let mut text = String::new();
            for (id, (kind, name, default)) in [$((stringify!($type), stringify!($name), stringify!($default)),)*].iter().enumerate() {
                text += &format!("layout(constant_id = {id}) const {kind} IO_{} = {default};\n", name.to_uppercase());
            }
            text
        }
    };
}

specialization! {
    /// Number of faces of the space's only cell, so that face tests unroll and read at constant places; 0 if it has
    /// several cells or too many faces to unroll.
    faces: uint = 0;
    /// The scene has triangles.
    meshes: bool = true;
    /// The scene has quadrics.
    quadrics: bool = true;
    /// A material has an alpha mask.
    alpha_mask: bool = true;
    /// A material has a texture.
    textures: bool = true;
    /// A material is coloured by place.
    coordinates: bool = true;
    /// There are point lights.
    lights: bool = true;
    /// A point light throws shadows.
    shadows: bool = true;
    /// There is a light at the viewer.
    headlight: bool = true;
    /// There is fog.
    fog: bool = true;
    /// Geodesics end at a finite distance.
    max_distance: bool = true;
    /// The length of primary rays matters: to the picture, to where they end, or to the error of arcs.
    lengths: bool = true;
    /// Cells are labelled by their deck elements.
    labels: bool = true;
    /// Work is counted.
    counters: bool = true;
    /// One of the `SHADING_` numbers.
    shading: uint = 0;
    /// One of the `INTEGRATOR_` numbers.
    integrator: uint = 0;
    /// Eyes of a headset: a pixel has one sample, and its fourth number is the distance of what is seen.
    eyes: bool = false;
    /// Only the pixels of a list have rays.
    listed: bool = false;
    /// One more than the counter that pixels show instead of what is seen; 0 for none.
    heat: uint = 0;
    /// The invocations of a subgroup, at most eight, walk the hierarchy together, with a stack of so many words, its depth
    /// among them; 0 if each walks alone.
    together: uint = 0;
    /// Kinds of instances that a segment meets only if it is near one of their guards.
    guarded: uint = 0;
    /// Number of guards about meshes.
    mesh_guards: uint = 0;
    /// Number of guards about quadrics, behind those about meshes.
    quadric_guards: uint = 0;
}

/// Declares buffer bindings of descriptor set 0 for both sides.
macro_rules! bindings {
    (
        $($(#[doc = $doc:literal])* $number:literal $name:ident: $access:ident $type:ident;)*
        uniform {
            $($(#[doc = $uniform_doc:literal])* $uniform:literal $uniform_name:ident: $uniform_type:ident[$length:ident];)*
        }
    ) => {
        /// Binding numbers of descriptor set 0: storage buffers, and behind them uniform buffers.
        pub mod binding {
            $($(#[doc = $doc])* #[allow(non_upper_case_globals)] pub const $name: u32 = $number;)*
            $($(#[doc = $uniform_doc])* #[allow(non_upper_case_globals)] pub const $uniform_name: u32 = $uniform;)*
        }

        /// Number of storage buffers: bindings from 0 on.
        pub const STORAGE_BUFFERS: u32 = [$($number),*].len() as u32;
        /// Number of uniform buffers, behind them.
        pub const UNIFORM_BUFFERS: u32 = [$($uniform),*].len() as u32;
        /// Number of bindings.
        pub const BINDINGS: u32 = STORAGE_BUFFERS + UNIFORM_BUFFERS;

        /// GLSL declarations of all bindings.
        pub const BINDINGS_GLSL: &str = concat!(
            $("layout(set = 0, binding = ", stringify!($number), ", scalar) ", stringify!($access), " buffer Io_",
              stringify!($name), " { ", stringify!($type), " io_", stringify!($name), "[]; };\n",)*
            $("layout(set = 0, binding = ", stringify!($uniform), ", scalar) uniform Io_", stringify!($uniform_name), " { ",
              stringify!($uniform_type), " io_", stringify!($uniform_name), "[IO_", stringify!($length), "]; };\n",)*
        );
    };
}

bindings! {
    /// One `View`.
    0 view: readonly View;
    /// All faces of all cells.
    1 faces: readonly Face;
    /// The cells.
    2 cells: readonly Cell;
    /// Bounding volume hierarchies.
    3 nodes: readonly Node;
    /// Stacks of the subgroups that walk the hierarchy together, each after its depth.
    4 stacks: restrict uint;
    /// Corners of triangles.
    5 triangles: readonly Triangle;
    /// Their shading data.
    6 triangle_shading: readonly TriangleShading;
    /// Quadrics.
    7 quadric_surfaces: readonly Quadric;
    /// Their shading data.
    17 quadric_shading: readonly QuadricShading;
    /// Materials.
    8 materials: readonly Material;
    /// Textures.
    9 texture_table: readonly Texture;
    /// Texels: two words each.
    10 texels: readonly uvec2;
    /// Light images.
    11 light_images: readonly Light;
    /// Deck element behind each face: element × faces table.
    12 label_table: readonly uint;
    /// Linear colour or raw value per pixel, summed over samples.
    13 pixels: restrict vec4;
    /// Work counters.
    14 counts: coherent uint;
    /// Arguments of the probe.
    15 probe_in: readonly ProbeIn;
    /// Results of the probe.
    16 probe_out: writeonly ProbeOut;
    /// Voxels of the cells: a bit for each, level by level (`src/render/world/voxels.rs`).
    18 voxels: readonly uint;
    /// Vertices of moving meshes at rest.
    19 rest: readonly RestVertex;
    /// Their corners: three indices for each triangle.
    20 rest_corners: readonly uint;
    /// The triangles, to be written.
    21 placed: writeonly Triangle;
    /// Their shading data, to be written.
    22 placed_shading: writeonly TriangleShading;
    /// The boxes about them, to be written.
    23 placed_boxes: writeonly Box;
    /// Arcs in flight, one for each invocation of a launch.
    24 arcs: coherent Arc;
    /// Rays walked without a scene.
    25 walks: restrict Walk;
    /// The faces that each of them passes: as many for each as there is room for.
    26 passages: writeonly uint;
    /// Pixels that have rays: column, row and eye in the bits of a word.
    27 rays: readonly uint;
    /// Pixels in a row that share a ray, for each square of [`RATE_TILE`](super::RATE_TILE) pixels of each eye.
    28 rates: readonly uint;
    /// Pixels of the eyes as the image wants them: one or two words each.
    29 packed: writeonly uint;
    /// Depths of the eyes.
    30 depths: writeonly float;
    /// For each box of each cell's grid of lights the place in here of its list; the lists of light images.
    31 light_lists: readonly uint;

    uniform {
        /// Planes of the faces of the only cell, if they are [`UNROLLED_FACES`](super::UNROLLED_FACES) at most: hardware
        /// computes with uniform numbers where they are.
        32 planes: vec4[UNROLLED_FACES];
        /// Boxes about what rests in the only cell, asked before a segment is traced: read by address, which `arrays` has.
        33 guards: Guard[GUARDS];
        /// Arrays that software reads by address: the address, and the index of the last element.
        34 arrays: uvec4[ARRAYS];
    }
}

/// Text of `shared/io.glsl`.
pub fn glsl() -> String {
    let head = "// Generated by the build from src/shader_io.rs: do not edit.\n#ifndef IO_GLSL\n#define IO_GLSL\n";
    let push = concat!(
        "#ifdef IO_DISPATCH\nlayout(push_constant, scalar) uniform IoDispatch { Dispatch io_dispatch; };\n#endif\n",
        "#ifdef IO_PLACEMENT\nlayout(push_constant, scalar) uniform IoPlacement { Placement io_placement; };\n#endif\n",
        "#ifdef IO_RESOLVE\nlayout(push_constant, scalar) uniform IoResolve { Resolve io_resolve; };\n#endif\n",
    );
    [head, STRUCTURES_GLSL, &numbers_glsl(), &specialization_glsl(), BINDINGS_GLSL, push, "#endif\n"].concat()
}
