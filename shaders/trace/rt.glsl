// The seam, ray tracing side: the device's traversal, one trace per segment. Miss shaders rewrite the payload and
// raygen traces again, so the depth of recursion is 1 whatever the number of bounces.
#ifndef RT_GLSL
#define RT_GLSL
#include "trace/payload.glsl"

layout(location = PAYLOAD) rayPayloadEXT Payload rt_payload;

// Without masks any-hit shaders need not be looked for.
const uint RT_FLAGS = IO_ALPHA_MASK ? gl_RayFlagsNoneEXT : gl_RayFlagsOpaqueEXT;
const uint RT_SHADOW_FLAGS = RT_FLAGS | gl_RayFlagsTerminateOnFirstHitEXT | gl_RayFlagsSkipClosestHitShaderEXT;

// What is in a cell. Cells have charts of their own, so each has an acceleration structure of its own.
accelerationStructureEXT rt_scene(uint cell) {
    return accelerationStructureEXT(io_scenes[cell]);
}

// Traces one segment of a pixel's ray, which closest-hit or miss follows, or of a shadow ray, which a hit ends. Both by one
// call, so that the invocations which hardware runs in lockstep may trace the one and the other at the same time.
void trace_segment(inout Path path, inout Hit hit, Segment segment, bool shadow) {
    if (!(IO_MESHES || IO_QUADRICS)) {
        stage_transport(path, io_view[0].bounces, IO_LENGTHS);
        return;
    }
    payload_bend(segment);
    rt_payload.path = path;
    // A shadow ray has hit something unless its miss shader says otherwise.
    if (shadow) rt_payload.path.status = PATH_HIT;
    uint flags = shadow ? RT_SHADOW_FLAGS : RT_FLAGS;
    uint miss = shadow ? MISS_SHADOW : MISS_PRIMARY;
#ifdef RT_REORDER
    // Invocations that will run the same shader are brought together before they run it.
    hitObjectNV found;
    hitObjectTraceRayNV(found, rt_scene(walk_cell(path)), flags, 0xffu, 0u, 1u, miss,
                        segment.origin, 0.0, segment.direction, 1.0, PAYLOAD);
    reorderThreadNV(found);
    hitObjectExecuteShaderNV(found, PAYLOAD);
#else
    traceRayEXT(rt_scene(walk_cell(path)), flags, 0xffu, 0u, 1u, miss,
                segment.origin, 0.0, segment.direction, 1.0, PAYLOAD);
#endif
    path = rt_payload.path;
    hit = rt_payload.hit;
}

#endif
