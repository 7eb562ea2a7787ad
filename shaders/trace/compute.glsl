// The seam, compute side: traversal of the hierarchy that the host built. It calls the same stages as the entry
// points of the ray tracing pipeline do: quadric_hit (intersection), stage_is_hole (any-hit), stage_hit_triangle and
// stage_hit_quadric (closest-hit), stage_transport (miss).
#ifndef COMPUTE_GLSL
#define COMPUTE_GLSL
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "shared/io.glsl"
#define WALK_TOGETHER
#include "stage/walk.glsl"
#include "stage/triangle.glsl"
#include "stage/quadric.glsl"
#include "stage/mask.glsl"
#include "stage/hit.glsl"

// A segment in units of the grid: it passes line x of an axis at s = x reciprocal + lower, where a box begins, and + upper,
// where one ends. An arc lies between its chord and the chord shifted by a quarter of the bend, so a box that is as much
// larger to the other side is entered by the chord no later than the box is by the arc.
struct Slabs {
    vec3 reciprocal;
    vec3 lower;
    vec3 upper;
    uint down; // one bit for each axis along which the segment goes down
};

Slabs slabs_of(Segment segment, Cell cell) {
    vec3 origin = (segment.origin - cell.grid_lower) * cell.grid_scale;
    vec3 bulge = GEO_STRAIGHT ? vec3(0.0) : 0.25 * segment.bend * cell.grid_scale;
    vec3 direction = segment.direction * cell.grid_scale;
    // A zero component would make 0 * inf = NaN at a box face; a tiny one behaves as a parallel ray.
    direction = mix(direction, vec3(1e-20), lessThan(abs(direction), vec3(1e-20)));
    vec3 reciprocal = 1.0 / direction;
    uvec3 down = uvec3(lessThan(direction, vec3(0.0)));
    return Slabs(reciprocal, -reciprocal * (origin + max(bulge, vec3(0.0))), -reciprocal * (origin + min(bulge, vec3(0.0))),
                 down.x | down.y << 1u | down.z << 2u);
}

// Cuts [enter, leave] down to the slabs of four boxes along an axis.
void slabs_cut(uvec4 lines, float reciprocal, float lower, float upper, inout vec4 enter, inout vec4 leave) {
    vec4 a = fma(vec4(lines & 0xffffu), vec4(reciprocal), vec4(lower));
    vec4 b = fma(vec4(lines >> 16u), vec4(reciprocal), vec4(upper));
    enter = max(enter, min(a, b));
    leave = min(leave, max(a, b));
}

// Which boxes of a node the segment enters before s_end: one bit for each child. Both ends are rounded (Ize: Robust BVH
// ray traversal, 2013).
uint slabs_entered(Slabs slabs, Node node, float s_end) {
    vec4 enter = vec4(0.0);
    vec4 leave = vec4(s_end);
    slabs_cut(node.x, slabs.reciprocal.x, slabs.lower.x, slabs.upper.x, enter, leave);
    slabs_cut(node.y, slabs.reciprocal.y, slabs.lower.y, slabs.upper.y, enter, leave);
    slabs_cut(node.z, slabs.reciprocal.z, slabs.lower.z, slabs.upper.z, enter, leave);
    uvec4 bits = mix(uvec4(0u), uvec4(1u, 2u, 4u, 8u), lessThanEqual(enter, leave * (1.0 + 5e-7)));
    return bits.x | bits.y | bits.z | bits.w;
}

// Invocations that walk the hierarchy together (IO_TOGETHER > 0) visit what any of them has to: where they run in lockstep
// that reads each node once for all.
uint together_or(uint bits) {
    return IO_TOGETHER > 0u ? subgroupOr(bits) : bits;
}

uint together_first(uint value) {
    return IO_TOGETHER > 0u ? subgroupBroadcastFirst(value) : value;
}

bool together_all(bool value) {
    // Not subgroupAll, which software answers lane by lane.
    return together_or(value ? 0u : 1u) == 0u;
}

// Index and kind of what a reference names.
uint reference_index(uint reference) {
    return reference & ((1u << IO_REFERENCE_SHIFT) - 1u);
}

uint reference_kind(uint reference) {
    return reference >> IO_REFERENCE_SHIFT;
}

bool reference_is_quadric(uint reference) {
    return IO_QUADRICS && (!IO_MESHES || reference_kind(reference) == IO_REFERENCE_QUADRIC);
}

// Where the segment meets a primitive before s_end.
float primitive_hit(Segment segment, uint reference, float s_end) {
    uint index = reference_index(reference);
    if (reference_is_quadric(reference)) {
        count(IO_COUNT_QUADRICS);
        return quadric_hit(segment, index, s_end);
    }
    count(IO_COUNT_TRIANGLES);
    vec3 hit = triangle_hit(segment, io_triangles[index]);
    return IO_ALPHA_MASK && hit.x < s_end && stage_is_hole(index, hit.yz) ? NO_HIT : hit.x;
}

// First entry of the subgroup's stack. Its depth is kept before it, in memory as well: software would keep a variable that
// a loop changes in a vector, and take long to get at its only number.
uint together_stack() {
    uint group = (gl_WorkGroupID.z * gl_NumWorkGroups.y + gl_WorkGroupID.y) * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    return (group * gl_NumSubgroups + gl_SubgroupID) * IO_TOGETHER + 1u;
}

// Which entries of a common stack an invocation would visit by itself: a bit each, only kept where nodes are counted.
uint together_owned[IO_STACK_SIZE / 32u];

bool together_counts() {
    return IO_TOGETHER > 0u && (IO_COUNTERS || IO_HEAT == IO_COUNT_NODES + 1u);
}

void together_own(uint entry, bool own) {
    if (!together_counts()) return;
    uint bit = 1u << (entry & 31u);
    together_owned[entry >> 5u] = (together_owned[entry >> 5u] & ~bit) | (own ? bit : 0u);
}

bool together_owns(uint entry) {
    return !together_counts() || ((together_owned[entry >> 5u] >> (entry & 31u)) & 1u) != 0u;
}

// Walks the hierarchy of a cell front to back; returns the primitive hit, or IO_NONE. With `any_hit` the first one found
// will do. Choices that all invocations of a subgroup share are made without branches, as far as possible: software keeps
// what branches and loops change in vectors, and what they do not in scalars.
uint traverse_cell(Segment segment, uint cell, bool any_hit) {
    uint found = IO_NONE;
    uint root = io_cells[cell].root;
    if (root == IO_NONE) return found;
    Slabs slabs = slabs_of(segment, io_cells[cell]);
    uint down = together_first(slabs.down);
    float s_end = 1.0 + 1e-6;
    uint stack[IO_STACK_SIZE]; // of an invocation that walks alone
    uint base = together_stack();
    if (IO_TOGETHER > 0u) io_stacks[base] = root; else stack[0] = root;
    together_own(0u, true);
    uint depth = 1u;
    if (IO_TOGETHER > 0u) io_stacks[base - 1u] = 1u;
    while (true) {
        uint top = (IO_TOGETHER > 0u ? io_stacks[base - 1u] : depth) - 1u;
        uint current = IO_TOGETHER > 0u ? io_stacks[base + top] : stack[top];
        Node node = io_nodes[reference_index(current)];
        if (together_owns(top)) count(IO_COUNT_NODES);
        uint own = slabs_entered(slabs, node, s_end);
        uint entered = together_or(own);
        // The children from near to far: primitives at once.
        bool from_last = ((down >> reference_kind(current)) & 1u) != 0u;
        uvec4 children = from_last ? node.children.wzyx : node.children;
        uvec4 bits = from_last ? uvec4(8u, 4u, 2u, 1u) : uvec4(1u, 2u, 4u, 8u);
        bvec4 among = notEqual(bits & entered, uvec4(0u));
        [[unroll]] for (uint i = 0u; i < 4u; i++) {
            if (among[i] && reference_kind(children[i]) > IO_REFERENCE_NOTHING) {
                if ((own & bits[i]) != 0u) {
                    float s = primitive_hit(segment, children[i], s_end);
                    if (s < s_end) {
                        s_end = s;
                        found = children[i];
                    }
                }
            }
        }
        // Nodes from far to near, so that the nearest is on top. What is none is written over.
        [[unroll]] for (uint k = 0u; k < 4u; k++) {
            uint i = 3u - k;
            if (IO_TOGETHER > 0u) io_stacks[base + top] = children[i]; else stack[top] = children[i];
            together_own(top, (own & bits[i]) != 0u);
            top += among[i] && reference_kind(children[i]) < IO_REFERENCE_NOTHING ? 1u : 0u;
        }
        if (top == 0u) break;
        if (IO_TOGETHER > 0u) io_stacks[base - 1u] = top; else depth = top;
        if (any_hit) {
            if (together_all(found != IO_NONE)) break;
            if (found != IO_NONE) s_end = -1.0;
        }
    }
    return found;
}

// The same for the cell that a path is in.
uint traverse(Segment segment, uint cell, bool any_hit) {
    uint found = IO_NONE;
    if (!(IO_MESHES || IO_QUADRICS)) return found;
    if (IO_TOGETHER == 0u || IO_FACES > 0u) return traverse_cell(segment, cell, any_hit);
    // Together go those that are in the same cell.
    for (bool waiting = true; waiting;) {
        uint first = subgroupBroadcastFirst(cell);
        if (first == cell) {
            found = traverse_cell(segment, first, any_hit);
            waiting = false;
        }
    }
    return found;
}

// Traces one segment of a primary ray: closest-hit or miss follows.
void trace_segment(inout Path path, inout Hit hit, Segment segment) {
    uint reference = traverse(segment, walk_cell(path), false);
    uint index = reference_index(reference);
    if (reference == IO_NONE) {
        stage_transport(path, io_view[0].bounces, IO_LENGTHS);
    } else if (reference_is_quadric(reference)) {
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
        stage_transport(path, IO_SHADOW_BOUNCES, true);
    }
}

#endif
