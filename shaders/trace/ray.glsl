// The segment of the ray in flight, for the stages that meet primitives.
#ifndef RAY_GLSL
#define RAY_GLSL
#include "trace/payload.glsl"

Segment ray_along(Arc arc) {
    return Segment(arc.origin, arc.direction, arc.bend);
}

Segment ray_segment() {
    if (!GEO_STRAIGHT) return ray_along(io_arcs[payload_launch()]);
    return Segment(gl_WorldRayOriginEXT, gl_WorldRayDirectionEXT, vec3(0.0));
}

#endif
