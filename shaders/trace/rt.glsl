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

// Whether a segment comes near a guard.
bool rt_beside(Slabs slabs, Box guard) {
    vec3 a = fma(guard.lower, slabs.reciprocal, slabs.lower);
    vec3 b = fma(guard.upper, slabs.reciprocal, slabs.upper);
    vec3 enter = min(a, b);
    vec3 leave = max(a, b);
    return max(max(enter.x, enter.y), max(enter.z, 0.0)) <= min(min(leave.x, leave.y), min(leave.z, 1.0));
}

// Kinds of instances that the segment may meet (src/render/rt/guards.rs).
uint rt_near(Segment segment) {
    if (!(IO_MESHES || IO_QUADRICS)) return 0u;
    if (IO_GUARDED == 0u) return IO_KIND_ALL;
    Slabs slabs = slabs_of(segment, vec3(0.0), vec3(1.0));
    bool meshes = false;
    bool quadrics = false;
    [[unroll]] for (uint i = 0u; i < IO_MESH_GUARDS; i++) meshes = rt_beside(slabs, array_guard(i)) || meshes;
    const uint all = IO_MESH_GUARDS + IO_QUADRIC_GUARDS;
    [[unroll]] for (uint i = IO_MESH_GUARDS; i < all; i++) quadrics = rt_beside(slabs, array_guard(i)) || quadrics;
    return (IO_KIND_ALL & ~IO_GUARDED) | (meshes ? IO_KIND_MESHES : 0u) | (quadrics ? IO_KIND_QUADRICS : 0u);
}

// Traces one segment of a pixel's ray, which closest-hit or miss follows, or of a shadow ray, which a hit ends. Both by one
// call, so that the invocations which hardware runs in lockstep may trace the one and the other at the same time.
void trace_segment(inout Path path, inout Hit hit, Segment segment, bool shadow) {
    uint near = rt_near(segment);
    if (near == 0u || !voxels_near(segment, walk_cell(path))) {
        stage_miss(path, shadow);
        return;
    }
    payload.path = path;
    pieces_trace(segment, walk_cell(path), near, shadow);
    path = payload.path;
    hit = payload.hit;
}

#endif
