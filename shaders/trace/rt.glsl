// The seam, ray tracing side: the device's traversal, one trace per segment. Miss shaders rewrite the payload and
// raygen traces again, so the depth of recursion is 1 whatever the number of bounces.
#ifndef RT_GLSL
#define RT_GLSL
#extension GL_EXT_control_flow_attributes : require
#include "trace/payload.glsl"
#include "stage/arrays.glsl"
#include "stage/slabs.glsl"
#include "stage/voxels.glsl"

layout(location = PAYLOAD) rayPayloadEXT Payload payload;
#include "trace/pieces.glsl"

// What a segment may meet: instances of some kinds in an acceleration structure.
struct Near {
    uint kinds;
    uvec2 scene;
    uint guards; // how many it comes near
};

// Notes whether a segment comes near a guard about a kind.
void rt_beside(Slabs slabs, Guard guard, uint kind, inout Near near) {
    vec3 a = fma(guard.lower, slabs.reciprocal, slabs.lower);
    vec3 b = fma(guard.upper, slabs.reciprocal, slabs.upper);
    vec3 enter = min(a, b);
    vec3 leave = max(a, b);
    bool beside = max(max(enter.x, enter.y), max(enter.z, 0.0)) <= min(min(leave.x, leave.y), min(leave.z, 1.0));
    near.kinds |= beside ? kind : 0u;
    near.scene = beside ? guard.scene : near.scene;
    near.guards += beside ? 1u : 0u;
}

// What the segment may meet in a cell (src/render/rt/guards.rs). Cells have charts of their own, so each has an acceleration
// structure of its own; and so may a guard that the segment comes near alone.
Near rt_near(Segment segment, uint cell) {
    if (!(IO_MESHES || IO_QUADRICS)) return Near(0u, uvec2(0u), 0u);
    uvec2 whole = io_cells[cell].scene;
    if (IO_GUARDED == 0u) return Near(IO_KIND_ALL, whole, 0u);
    Near near = Near(IO_KIND_ALL & ~IO_GUARDED, whole, 0u);
    Slabs slabs = slabs_of(segment, vec3(0.0), vec3(1.0));
    [[unroll]] for (uint i = 0u; i < IO_MESH_GUARDS; i++) rt_beside(slabs, array_guard(i), IO_KIND_MESHES, near);
    const uint all = IO_MESH_GUARDS + IO_QUADRIC_GUARDS;
    [[unroll]] for (uint i = IO_MESH_GUARDS; i < all; i++) rt_beside(slabs, array_guard(i), IO_KIND_QUADRICS, near);
    if (IO_GUARDED != IO_KIND_ALL || near.guards != 1u || near.scene == uvec2(0u)) near.scene = whole;
    return near;
}

// Traces one segment of a pixel's ray, which closest-hit or miss follows, or of a shadow ray, which a hit ends. Both by one
// call, so that the invocations which hardware runs in lockstep may trace the one and the other at the same time.
void trace_segment(inout Path path, inout Hit hit, Segment segment, bool shadow) {
    Near near = rt_near(segment, walk_cell(path));
    if (near.kinds == 0u || !voxels_near(segment, walk_cell(path))) {
        stage_miss(path, shadow);
        return;
    }
    payload.path = path;
    pieces_trace(segment, near.scene, near.kinds, shadow);
    path = payload.path;
    hit = payload.hit;
}

#endif
