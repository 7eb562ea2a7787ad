// The seam, compute side: traversal of the hierarchy that the host built. It calls the same stages as the entry
// points of the ray tracing pipeline do: quadric_hit (intersection), stage_is_hole (any-hit), stage_hit_triangle and
// stage_hit_quadric (closest-hit), stage_miss.
#ifndef COMPUTE_GLSL
#define COMPUTE_GLSL
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_shuffle : require
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

// The lowest bits of the bytes that stand for the children of a node.
const uvec4 CHILDREN = uvec4(1u, 1u << 8u, 1u << 16u, 1u << 24u);

// Cuts [enter, leave] down to the slabs of four boxes along an axis.
void slabs_cut(uvec4 lines, float reciprocal, float lower, float upper, inout vec4 enter, inout vec4 leave) {
    vec4 a = fma(vec4(lines & 0xffffu), vec4(reciprocal), vec4(lower));
    vec4 b = fma(vec4(lines >> 16u), vec4(reciprocal), vec4(upper));
    enter = max(enter, min(a, b));
    leave = min(leave, max(a, b));
}

// Room for the rounding of both ends (Ize: Robust BVH ray traversal, 2013).
const float SLABS_ROOM = 1.0 + 5e-7;

// Which boxes of a node the segment enters before s_end: the lowest bit of a byte for each child.
uint slabs_entered(Slabs slabs, Node node, float s_end) {
    vec4 enter = vec4(0.0);
    vec4 leave = vec4(s_end);
    slabs_cut(node.x, slabs.reciprocal.x, slabs.lower.x, slabs.upper.x, enter, leave);
    slabs_cut(node.y, slabs.reciprocal.y, slabs.lower.y, slabs.upper.y, enter, leave);
    slabs_cut(node.z, slabs.reciprocal.z, slabs.lower.z, slabs.upper.z, enter, leave);
    uvec4 bits = mix(uvec4(0u), CHILDREN, lessThanEqual(enter, leave * SLABS_ROOM));
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
// that reads each node once for all. First word of the subgroup's stack. How many of them are in use is kept before it, in
// memory as well: software would keep a variable that a loop changes in a vector, and take long to get at its only number.
uint together_stack() {
    uint group = (gl_WorkGroupID.z * gl_NumWorkGroups.y + gl_WorkGroupID.y) * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    return (group * gl_NumSubgroups + gl_SubgroupID) * IO_TOGETHER + 1u;
}

// The invocations that walk together, at most eight.
struct Lanes {
    uint all;   // a bit each
    uint child; // the box that this one looks at where they share a node's boxes
    bool apart; // whether they can: there is one for each box
    bool twice; // whether two of them look at each box
    bool later; // whether this one is the second of the two
};

Lanes together_lanes() {
    uint lane = gl_SubgroupInvocationID;
    uint all = subgroupOr(1u << lane);
    uint rank = uint(bitCount(all & ((1u << lane) - 1u)));
    uint number = uint(bitCount(all));
    // Arcs meet voxels before they come here, and are few.
    return Lanes(all, rank & 3u, GEO_STRAIGHT && number >= 4u, number == 8u, number == 8u && rank >= 4u);
}

// Whether the segment of invocation `ray` enters one box of a node before its s_end, as a bit of that ray's in the child's
// byte.
uint slabs_entered_one(Slabs slabs, Node node, float s_end, uint child, uint ray) {
    vec3 reciprocal = subgroupShuffle(slabs.reciprocal, ray);
    uvec3 lines = uvec3(node.x[child], node.y[child], node.z[child]);
    vec3 a = fma(vec3(lines & 0xffffu), reciprocal, subgroupShuffle(slabs.lower, ray));
    vec3 b = fma(vec3(lines >> 16u), reciprocal, subgroupShuffle(slabs.upper, ray));
    vec3 enter = min(a, b);
    vec3 leave = max(a, b);
    float last = min(min(leave.x, leave.y), min(leave.z, subgroupShuffle(s_end, ray)));
    return max(max(enter.x, enter.y), max(enter.z, 0.0)) <= last * SLABS_ROOM ? 1u << (8u * child + ray) : 0u;
}

// Which boxes of a node the segments enter: a byte for each child, in it a bit for each invocation. `owners` are those who
// come to the node. If they are one or two, each of their boxes is looked at by another invocation; else each looks at all
// boxes for its own segment.
uint slabs_entered_together(Slabs slabs, Node node, float s_end, Lanes lanes, uint owners, uint zero) {
    uint entered;
    uint second = owners & (owners - 1u);
    if (lanes.apart && (second & (second - 1u)) == 0u) {
        uint ray = uint(lanes.later ? findMSB(owners) : findLSB(owners));
        entered = slabs_entered_one(slabs, node, s_end, lanes.child, ray);
        if (!lanes.twice && second != 0u) {
            entered |= slabs_entered_one(slabs, node, s_end, lanes.child, uint(findMSB(owners)));
        }
    } else {
        Node spread = Node(node.x | zero, node.y | zero, node.z | zero, node.children);
        entered = slabs_entered(slabs, spread, s_end) << gl_SubgroupInvocationID;
    }
    return subgroupOr(entered);
}

// The bytes of those children of a node that are no nodes.
uint node_ends(Node node) {
    uvec4 bits = (node.children >> (IO_REFERENCE_END_BIT - uvec4(0u, 8u, 16u, 24u))) & CHILDREN;
    return 255u * (bits.x | bits.y | bits.z | bits.w);
}

// Whether the last of a node's children is the nearest to rays that go `down` along some axes: it is sorted along one.
bool node_reversed(uint reference, uint down) {
    return ((down >> reference_kind(reference)) & 1u) != 0u;
}

// Walks the hierarchy of a cell front to back, all invocations of a subgroup together; returns the primitive hit, or IO_NONE.
// With `any_hit` the first one found will do. An entry of the stack is a node and, a byte each, the invocations that still
// have to go to its children: the lowest entry a node above the root. Choices that all share are made without branches, as far
// as possible: software keeps what branches and loops change in vectors, and what they do not in scalars.
uint traverse_together(Segment segment, uint cell, bool any_hit) {
    uint found = IO_NONE;
    uint root = io_cells[cell].root;
    if (root == IO_NONE) return found;
    Slabs slabs = slabs_of(segment, io_cells[cell].grid_lower, io_cells[cell].grid_scale);
    Lanes lanes = together_lanes();
    uint down = subgroupBroadcastFirst(slabs.down);
    float s_end = 1.0 + 1e-6;
    uint stack = together_stack();
    uvec4 nodes = io_arrays[IO_ARRAY_NODES];
    // 0 in each lane by itself, so that software makes floats of a node's boxes in all lanes at once; what is the same in all it
    // computes once, and has to spread each float over the lanes.
    uint zero = slabs.down >> 3u;
    io_stacks[stack] = root;
    io_stacks[stack + 1u] = lanes.all;
    io_stacks[stack - 1u] = 2u;
    while (true) {
        uint depth = io_stacks[stack - 1u];
        uint parent = io_stacks[stack + depth - 2u];
        uint rest = io_stacks[stack + depth - 1u];
        // The nearest child that any of them has to go to.
        uint child = (uint(node_reversed(parent, down) ? findMSB(rest) : findLSB(rest)) >> 3u) & 3u;
        uint owners = (rest >> (8u * child)) & 255u;
        rest &= ~(255u << (8u * child));
        uint current = array_child(nodes, reference_index(parent), child);
        Node node = array_node(nodes, reference_index(current));
        if (((owners >> gl_SubgroupInvocationID) & 1u) != 0u) count(IO_COUNT_NODES);
        uint entered = slabs_entered_together(slabs, node, s_end, lanes, owners, zero);
        uint ends = node_ends(node);
        // Primitives at once. Most nodes have none that is entered.
        if ((entered & ends) != 0u) {
            [[unroll]] for (uint i = 0u; i < 4u; i++) {
                uint name = node.children[i];
                uint testers = ((entered & ends) >> (8u * i)) & 255u;
                // A segment may pass through the point that is the box of nothing.
                if (testers != 0u && reference_kind(name) > IO_REFERENCE_NOTHING) {
                    if (((testers >> gl_SubgroupInvocationID) & 1u) != 0u) {
                        float s = leaf_hit(segment, name, s_end);
                        if (s < s_end) {
                            s_end = s;
                            found = name;
                        }
                    }
                }
            }
            if (any_hit) {
                if (found != IO_NONE) s_end = -1.0;
                // Not subgroupAll, which software answers lane by lane.
                if (subgroupOr(found == IO_NONE ? 1u : 0u) == 0u) break;
            }
        }
        // The node's own nodes come next, or the rest of its parent's, or those that have waited longer.
        uint below = entered & ~ends;
        io_stacks[stack + depth - 1u] = rest;
        depth -= rest == 0u ? 2u : 0u;
        io_stacks[stack + depth] = current;
        io_stacks[stack + depth + 1u] = below;
        depth += below != 0u ? 2u : 0u;
        if (depth == 0u) break;
        io_stacks[stack - 1u] = depth;
    }
    return found;
}

// The children of a node from near to far, and the bits that stand for them.
struct Children {
    uvec4 references;
    uvec4 bits;
};

Children node_children(Node node, uint reference, uint down) {
    return node_reversed(reference, down) ? Children(node.children.wzyx, CHILDREN.wzyx) : Children(node.children, CHILDREN);
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
