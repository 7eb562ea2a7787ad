// The segment of the ray in flight, for the stages that meet primitives.
#ifndef RAY_GLSL
#define RAY_GLSL
#include "trace/payload.glsl"

Segment ray_segment() {
    return Segment(gl_WorldRayOriginEXT, gl_WorldRayDirectionEXT, GEO_STRAIGHT ? vec3(0.0) : io_bends[payload_launch()]);
}

#endif
