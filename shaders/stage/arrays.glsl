// The arrays that traversal reads, element by element. Software checks every word that it reads through a binding against the
// binding's end, which for a node is a third of all work: there, invocations that walk together, and guards, read by address.
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

// Declares a function that reads an element of a bound array, or the same by the address that io_arrays has of it; and one that is
// given what io_arrays has, for loops that look it up once. Software may run code with all invocations switched off, so no index
// leaves its array.
#define ARRAYS_READ(function, Element, Elements, bound, number) \
    layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Elements { Element at[]; }; \
    Element function(uvec4 array, uint index) { \
        return Elements(array.xy).at[min(index, array.z)]; \
    } \
    Element function(uint index) { \
        if (!ARRAYS_ADDRESSED) return bound[index]; \
        return function(io_arrays[number], index); \
    }

ARRAYS_READ(array_node, Node, Nodes, io_nodes, IO_ARRAY_NODES)
ARRAYS_READ(array_pair, Triangle, Triangles, io_triangles, IO_ARRAY_TRIANGLES)
ARRAYS_READ(array_quadric, Quadric, Quadrics, io_quadric_surfaces, IO_ARRAY_QUADRICS)
ARRAYS_READ(array_quadric_shading, QuadricShading, QuadricShadings, io_quadric_shading, IO_ARRAY_QUADRIC_SHADING)

// One of a node's children.
uint array_child(uvec4 nodes, uint index, uint child) {
    return Nodes(nodes.xy).at[min(index, nodes.z)].children[child];
}

// There are none but on software.
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Guards { Guard at[]; };

Guard array_guard(uint index) {
    return Guards(io_arrays[IO_ARRAY_GUARDS].xy).at[index];
}

#endif
