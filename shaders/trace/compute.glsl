// The seam, compute side: traversal of the hierarchy that the host built. It calls the same stages as the entry
// points of the ray tracing pipeline do: quadric_hit (intersection), stage_is_hole (any-hit), stage_hit_triangle and
// stage_hit_quadric (closest-hit), stage_transport (miss).
#ifndef COMPUTE_GLSL
#define COMPUTE_GLSL
#include "shared/io.glsl"
#include "stage/walk.glsl"
#include "stage/triangle.glsl"
#include "stage/quadric.glsl"
#include "stage/mask.glsl"
#include "stage/hit.glsl"

// Entry of a segment into a box, in s, or NO_HIT if it does not enter before `s_end`. All in units of the grid. An arc
// lies between its chord and the chord shifted by a quarter of the bend, so a box that is as much larger to the other side
// is entered by the chord no later than the box is by the arc: the origin is another one for lower and for upper faces.
float box_entry(uvec3 lines, vec3 for_lower, vec3 for_upper, vec3 reciprocal, float s_end) {
    vec3 a = (vec3(lines & 0xffffu) - for_lower) * reciprocal;
    vec3 b = (vec3(lines >> 16u) - for_upper) * reciprocal;
    vec3 low = min(a, b);
    vec3 high = max(a, b);
    float enter = max(max(low.x, low.y), max(low.z, 0.0));
    float leave = min(min(high.x, high.y), min(high.z, s_end));
    return enter <= leave ? enter : NO_HIT;
}

// Whether a child's reference is a leaf, and its index.
bool node_is_leaf(uint reference) {
    return (reference >> IO_NODE_COUNT_SHIFT) > 0u;
}

// Nearest hit at s <= s_end among the primitives of a leaf.
void leaf_hits(Segment segment, uint leaf, inout float s_end, inout uint reference) {
    uint first = leaf & ((1u << IO_NODE_COUNT_SHIFT) - 1u);
    uint end = first + (leaf >> IO_NODE_COUNT_SHIFT);
    for (uint i = first; i < end; i++) {
        uint candidate = io_primitives[i];
        float s = NO_HIT;
        if (IO_QUADRICS && (!IO_MESHES || (candidate & IO_QUADRIC_BIT) != 0u)) {
            count(IO_COUNT_QUADRICS);
            s = quadric_hit(segment, candidate & ~IO_QUADRIC_BIT, s_end);
        } else if (IO_MESHES) {
            count(IO_COUNT_TRIANGLES);
            vec3 hit = triangle_hit(segment, io_triangles[candidate]);
            s = hit.x;
            if (IO_ALPHA_MASK && s < s_end && stage_is_hole(candidate, hit.yz)) s = NO_HIT;
        }
        if (s < s_end) {
            s_end = s;
            reference = candidate;
        }
    }
}

// Walks the hierarchy front to back; returns the primitive hit, or IO_NONE. With `any_hit` the first one found will do.
uint traverse(Segment segment, uint cell, bool any_hit) {
    uint reference = IO_NONE;
    uint root = io_cells[cell].root;
    if (!(IO_MESHES || IO_QUADRICS) || root == IO_NONE) return reference;
    // The segment in units of the grid. A zero component would make 0 * inf = NaN at a box face; a tiny one behaves
    // as a parallel ray.
    vec3 origin = (segment.origin - io_cells[cell].grid_lower) * io_cells[cell].grid_scale;
    vec3 bulge = GEO_STRAIGHT ? vec3(0.0) : 0.25 * segment.bend * io_cells[cell].grid_scale;
    vec3 for_lower = origin + max(bulge, vec3(0.0));
    vec3 for_upper = origin + min(bulge, vec3(0.0));
    vec3 direction = segment.direction * io_cells[cell].grid_scale;
    direction = mix(direction, vec3(1e-20), lessThan(abs(direction), vec3(1e-20)));
    vec3 reciprocal = 1.0 / direction;
    float s_end = 1.0 + 1e-6;
    uint stack[IO_STACK_SIZE];
    uint depth = 0u;
    uint current = root;
    while (true) {
        Node node = io_nodes[current];
        count(IO_COUNT_NODES);
        float s0 = box_entry(node.box0, for_lower, for_upper, reciprocal, s_end);
        float s1 = box_entry(node.box1, for_lower, for_upper, reciprocal, s_end);
        if (s0 != NO_HIT && node_is_leaf(node.child0)) {
            leaf_hits(segment, node.child0, s_end, reference);
            s0 = NO_HIT;
        }
        if (s1 <= s_end && node_is_leaf(node.child1)) {
            leaf_hits(segment, node.child1, s_end, reference);
            s1 = NO_HIT;
        }
        if (any_hit && reference != IO_NONE) return reference;
        bool in0 = s0 <= s_end;
        bool in1 = s1 <= s_end;
        if (in0 && in1) {
            bool swapped = s1 < s0;
            stack[depth++] = swapped ? node.child0 : node.child1;
            current = swapped ? node.child1 : node.child0;
        } else if (in0 || in1) {
            current = in0 ? node.child0 : node.child1;
        } else if (depth > 0u) {
            current = stack[--depth];
        } else {
            return reference;
        }
    }
}

// Traces one segment of a primary ray: closest-hit or miss follows.
void trace_segment(inout Path path, inout Hit hit, Segment segment) {
    uint reference = traverse(segment, walk_cell(path), false);
    uint index = reference & ~IO_QUADRIC_BIT;
    if (reference == IO_NONE) {
        stage_transport(path, io_view[0].bounces);
    } else if (IO_QUADRICS && (!IO_MESHES || index != reference)) {
        stage_hit_quadric(path, hit, segment, index, io_quadric_shading[index].material);
    } else {
        stage_hit_triangle(path, hit, segment, index, io_triangle_shading[index].material);
    }
}

// Traces one segment of a shadow ray: a hit ends it, a miss transports it.
void trace_shadow_segment(inout Path path, Segment segment) {
    if (traverse(segment, walk_cell(path), true) != IO_NONE) {
        path.status = PATH_HIT;
    } else {
        stage_transport(path, IO_SHADOW_BOUNCES);
    }
}

#endif
