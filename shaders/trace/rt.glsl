// The seam, ray tracing side: the device's traversal, one trace per segment. Miss shaders rewrite the payload and
// raygen traces again, so the depth of recursion is 1 whatever the number of bounces.
#ifndef RT_GLSL
#define RT_GLSL
#include "trace/payload.glsl"

layout(location = PAYLOAD_PRIMARY) rayPayloadEXT Payload rt_primary;
layout(location = PAYLOAD_SHADOW) rayPayloadEXT Path rt_shadow;

// Without masks any-hit shaders need not be looked for.
const uint RT_FLAGS = IO_ALPHA_MASK ? gl_RayFlagsNoneEXT : gl_RayFlagsOpaqueEXT;
const uint RT_SHADOW_FLAGS = RT_FLAGS | gl_RayFlagsTerminateOnFirstHitEXT | gl_RayFlagsSkipClosestHitShaderEXT;

// What is in a cell. Cells have charts of their own, so each has an acceleration structure of its own.
accelerationStructureEXT rt_scene(uint cell) {
    return accelerationStructureEXT(io_scenes[cell]);
}

// Traces one segment of a primary ray: closest-hit or miss follows.
void trace_segment(inout Path path, inout Hit hit, Segment segment) {
    if (!(IO_MESHES || IO_QUADRICS)) {
        stage_transport(path, io_view[0].bounces, IO_LENGTHS);
        return;
    }
    payload_bend(segment);
    rt_primary.path = path;
#ifdef RT_REORDER
    // Invocations that will run the same shader are brought together before they run it.
    hitObjectNV found;
    hitObjectTraceRayNV(found, rt_scene(walk_cell(path)), RT_FLAGS, 0xffu, 0u, 1u, MISS_PRIMARY,
                        segment.origin, 0.0, segment.direction, 1.0, PAYLOAD_PRIMARY);
    reorderThreadNV(found);
    hitObjectExecuteShaderNV(found, PAYLOAD_PRIMARY);
#else
    traceRayEXT(rt_scene(walk_cell(path)), RT_FLAGS, 0xffu, 0u, 1u, MISS_PRIMARY,
                segment.origin, 0.0, segment.direction, 1.0, PAYLOAD_PRIMARY);
#endif
    path = rt_primary.path;
    hit = rt_primary.hit;
}

// Traces one segment of a shadow ray: a hit ends it, a miss transports it.
void trace_shadow_segment(inout Path path, Segment segment) {
    payload_bend(segment);
    rt_shadow = path;
    rt_shadow.status = PATH_HIT;
    traceRayEXT(rt_scene(walk_cell(path)), RT_SHADOW_FLAGS, 0xffu, 0u, 1u, MISS_SHADOW,
                segment.origin, 0.0, segment.direction, 1.0, PAYLOAD_SHADOW);
    path = rt_shadow;
}

#endif
