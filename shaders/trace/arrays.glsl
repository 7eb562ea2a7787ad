// The arrays that traversal reads, element by element. Software checks every word that it reads through a binding against the
// binding's end, which for a node is a third of all work: there, invocations that walk together, and guards, read by address.
// Such software may run code with all invocations switched off, so no index leaves its array.
#ifndef ARRAYS_GLSL
#define ARRAYS_GLSL
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#include "shared/io.glsl"

#ifdef WALK_TOGETHER
const bool ARRAYS_ADDRESSED = IO_TOGETHER > 0u;
#else
const bool ARRAYS_ADDRESSED = false;
#endif

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Nodes { Node at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Triangles { Triangle at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Quadrics { Quadric at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer QuadricShadings { QuadricShading at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Boxes { Box at[]; };

Node array_node(uint index) {
    if (!ARRAYS_ADDRESSED) return io_nodes[index];
    uvec4 array = io_arrays[IO_ARRAY_NODES];
    return Nodes(array.xy).at[min(index, array.z)];
}

Triangle array_triangle(uint index) {
    if (!ARRAYS_ADDRESSED) return io_triangles[index];
    uvec4 array = io_arrays[IO_ARRAY_TRIANGLES];
    return Triangles(array.xy).at[min(index, array.z)];
}

Quadric array_quadric(uint index) {
    if (!ARRAYS_ADDRESSED) return io_quadric_surfaces[index];
    uvec4 array = io_arrays[IO_ARRAY_QUADRICS];
    return Quadrics(array.xy).at[min(index, array.z)];
}

QuadricShading array_quadric_shading(uint index) {
    if (!ARRAYS_ADDRESSED) return io_quadric_shading[index];
    uvec4 array = io_arrays[IO_ARRAY_QUADRIC_SHADING];
    return QuadricShadings(array.xy).at[min(index, array.z)];
}

// There are none but on software.
Box array_guard(uint index) {
    return Boxes(io_arrays[IO_ARRAY_GUARDS].xy).at[index];
}

#endif
