// The seam, compute side: traversal of the hierarchy that the host built. It calls the same stages as the entry
// points of the ray tracing pipeline do: quadric_hit (intersection), stage_is_hole (any-hit), stage_hit_triangle and
// stage_hit_quadric (closest-hit), stage_miss.
#ifndef COMPUTE_GLSL
#define COMPUTE_GLSL
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "shared/io.glsl"
#define WALK_TOGETHER
#include "stage/arrays.glsl"
#include "stage/walk.glsl"
#include "stage/triangle.glsl"
#include "stage/quadric.glsl"
#include "stage/mask.glsl"
#include "stage/hit.glsl"
#include "stage/slabs.glsl"
#include "stage/voxels.glsl"

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

// Where the segment meets a leaf before s_end. The reference becomes that of what it meets.
float leaf_hit(Segment segment, inout uint reference, float s_end) {
    uint index = reference_index(reference);
    if (reference_is_quadric(reference)) {
        count(IO_COUNT_QUADRICS);
        return quadric_hit(segment, index, s_end);
    }
    Triangle pair = array_pair(index / 2u);
    count(IO_COUNT_TRIANGLES);
    if (pair_has_second(pair)) count(IO_COUNT_TRIANGLES);
    vec3 first;
    vec3 second;
    pair_hits(segment, pair, first, second);
    if (IO_ALPHA_MASK && first.x < s_end && stage_is_hole(index, first.yz)) first.x = NO_HIT;
    if (IO_ALPHA_MASK && second.x < s_end && stage_is_hole(index + 1u, second.yz)) second.x = NO_HIT;
    if (second.x < first.x) reference++;
    return min(first.x, second.x);
}

// Invocations that walk the hierarchy together (IO_TOGETHER > 0) visit what any of them has to: where they run in lockstep
// that reads each node once for all. First entry of the subgroup's stack. Its depth is kept before it, in memory as well: software would keep a variable that
// a loop changes in a vector, and take long to get at its only number.
uint together_stack() {
    uint group = (gl_WorkGroupID.z * gl_NumWorkGroups.y + gl_WorkGroupID.y) * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    return (group * gl_NumSubgroups + gl_SubgroupID) * IO_TOGETHER + 1u;
}

// Which entries of a common stack an invocation would visit by itself: a bit each, only kept where nodes are counted.
uint together_owned[IO_STACK_SIZE / 32u];

bool together_counts() {
    return IO_COUNTERS || IO_HEAT == IO_COUNT_NODES + 1u;
}

void together_own(uint entry, bool own) {
    if (!together_counts()) return;
    uint bit = 1u << (entry & 31u);
    together_owned[entry >> 5u] = (together_owned[entry >> 5u] & ~bit) | (own ? bit : 0u);
}

bool together_owns(uint entry) {
    return !together_counts() || ((together_owned[entry >> 5u] >> (entry & 31u)) & 1u) != 0u;
}

// The children of a node from near to far, by the axis that it is sorted along, and the bits that stand for them.
struct Children {
    uvec4 references;
    uvec4 bits;
};

Children node_children(Node node, uint reference, uint down) {
    bool from_last = ((down >> reference_kind(reference)) & 1u) != 0u;
    return from_last ? Children(node.children.wzyx, uvec4(8u, 4u, 2u, 1u)) : Children(node.children, uvec4(1u, 2u, 4u, 8u));
}

// Which children of a node are primitives: a bit each.
uint node_primitives(Node node) {
    uvec4 bits = (node.children >> (IO_REFERENCE_PRIMITIVE_BIT - uvec4(0u, 1u, 2u, 3u))) & uvec4(1u, 2u, 4u, 8u);
    return bits.x | bits.y | bits.z | bits.w;
}

// Walks the hierarchy of a cell front to back, all invocations of a subgroup together; returns the primitive hit, or IO_NONE.
// With `any_hit` the first one found will do. Choices that all share are made without branches, as far as possible:
// software keeps what branches and loops change in vectors, and what they do not in scalars.
uint traverse_together(Segment segment, uint cell, bool any_hit) {
    uint found = IO_NONE;
    uint root = io_cells[cell].root;
    if (root == IO_NONE) return found;
    Slabs slabs = slabs_of(segment, io_cells[cell].grid_lower, io_cells[cell].grid_scale);
    uint down = subgroupBroadcastFirst(slabs.down);
    float s_end = 1.0 + 1e-6;
    uint base = together_stack();
    uvec4 nodes = io_arrays[IO_ARRAY_NODES];
    // 0 in each lane by itself, so that software makes floats of a node's boxes in all lanes at once; what is the same in all it
    // computes once, and has to spread each float over the lanes.
    uint zero = slabs.down >> 3u;
    io_stacks[base] = root;
    together_own(0u, true);
    io_stacks[base - 1u] = 1u;
    while (true) {
        uint top = io_stacks[base - 1u] - 1u;
        uint current = io_stacks[base + top];
        Node node = array_node(nodes, reference_index(current));
        if (together_owns(top)) count(IO_COUNT_NODES);
        uint own = slabs_entered(slabs, Node(node.x | zero, node.y | zero, node.z | zero, node.children), s_end);
        Children children = node_children(node, current, down);
        uint any_own = subgroupOr(own);
        bvec4 among = notEqual(children.bits & any_own, uvec4(0u));
        // Primitives at once. Most nodes have none that is entered.
        if ((node_primitives(node) & any_own) != 0u) {
            [[unroll]] for (uint i = 0u; i < 4u; i++) {
                uint child = children.references[i];
                if (among[i] && reference_kind(child) > IO_REFERENCE_NOTHING) {
                    if ((own & children.bits[i]) != 0u) {
                        float s = leaf_hit(segment, child, s_end);
                        if (s < s_end) {
                            s_end = s;
                            found = child;
                            if (any_hit) own = 0u;
                        }
                    }
                }
            }
        }
        // Nodes from far to near, so that the nearest is on top. What is none is written over.
        [[unroll]] for (uint k = 0u; k < 4u; k++) {
            uint i = 3u - k;
            io_stacks[base + top] = children.references[i];
            together_own(top, (own & children.bits[i]) != 0u);
            top += among[i] && reference_kind(children.references[i]) < IO_REFERENCE_NOTHING ? 1u : 0u;
        }
        if (top == 0u) break;
        io_stacks[base - 1u] = top;
        if (any_hit) {
            // Not subgroupAll, which software answers lane by lane.
            if (subgroupOr(found == IO_NONE ? 1u : 0u) == 0u) break;
            if (found != IO_NONE) s_end = -1.0;
        }
    }
    return found;
}

// The same for an invocation by itself. It walks nodes until one has primitives to test, so that those of a subgroup, which
// hardware runs in lockstep, test primitives at the same time although they are at different nodes (Aila and Laine:
// Understanding the efficiency of ray traversal on GPUs, 2009). Only nodes are put on the stack.
uint traverse_alone(Segment segment, uint cell, bool any_hit) {
    uint found = IO_NONE;
    uint current = io_cells[cell].root;
    if (current == IO_NONE) return found;
    Slabs slabs = slabs_of(segment, io_cells[cell].grid_lower, io_cells[cell].grid_scale);
    float s_end = 1.0 + 1e-6;
    uint stack[IO_STACK_SIZE];
    stack[0] = IO_NONE;
    uint depth = 1u;
    while (current != IO_NONE) {
        Children children;
        uint primitives = 0u; // a bit for each of the children
        while (current != IO_NONE && primitives == 0u) {
            Node node = array_node(reference_index(current));
            count(IO_COUNT_NODES);
            children = node_children(node, current, slabs.down);
            bvec4 among = notEqual(children.bits & slabs_entered(slabs, node, s_end), uvec4(0u));
            // From far to near: what comes next is on top.
            [[unroll]] for (uint k = 0u; k < 4u; k++) {
                uint i = 3u - k;
                uint kind = reference_kind(children.references[i]);
                if (among[i] && kind < IO_REFERENCE_NOTHING) stack[depth++] = children.references[i];
                if (among[i] && kind > IO_REFERENCE_NOTHING) primitives |= 1u << i;
            }
            current = stack[--depth];
        }
        for (; primitives != 0u; primitives &= primitives - 1u) {
            uint child = children.references[findLSB(primitives)];
            float s = leaf_hit(segment, child, s_end);
            if (s < s_end) {
                s_end = s;
                found = child;
                if (any_hit) {
                    current = IO_NONE;
                    break;
                }
            }
        }
    }
    return found;
}

// The same for the cell that a path is in.
uint traverse(Segment segment, uint cell, bool any_hit) {
    uint found = IO_NONE;
    if (!(IO_MESHES || IO_QUADRICS)) return found;
    if (IO_TOGETHER == 0u) return traverse_alone(segment, cell, any_hit);
    if (IO_FACES > 0u) return traverse_together(segment, cell, any_hit);
    // Together go those that are in the same cell.
    for (bool waiting = true; waiting;) {
        uint first = subgroupBroadcastFirst(cell);
        if (first == cell) {
            found = traverse_together(segment, first, any_hit);
            waiting = false;
        }
    }
    return found;
}

// Traces one segment of a pixel's ray, which closest-hit or miss follows, or of a shadow ray, which a hit ends.
void trace_segment(inout Path path, inout Hit hit, Segment segment, bool shadow) {
    uint reference = IO_NONE;
    if (voxels_near(segment, walk_cell(path))) reference = traverse(segment, walk_cell(path), shadow);
    uint index = reference_index(reference);
    if (reference == IO_NONE) {
        stage_miss(path, shadow);
    } else if (shadow) {
        path.status = PATH_HIT;
    } else if (reference_is_quadric(reference)) {
        stage_hit_quadric(path, hit, segment, index, io_quadric_shading[index].material);
    } else {
        stage_hit_triangle(path, hit, segment, index, io_triangle_shading[index].material);
    }
}

#endif
