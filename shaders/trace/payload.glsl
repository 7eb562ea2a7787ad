// What the ray tracing pipeline carries between raygen and the other stages.
#ifndef PAYLOAD_GLSL
#define PAYLOAD_GLSL
#include "stage/hit.glsl"

// A ray: 92 bytes, 64 of which any stage needs to move a geodesic on and 28 to say what a pixel's ray has hit. The material
// itself is read by raygen: its seven numbers would have to be kept alive through every traversal.
struct Payload {
    Path path;
    Hit hit;
};

// Its location.
const int PAYLOAD = 0;

// The device's traversal knows straight rays only: it looks for boxes about triangles near the chord of an arc, and the
// intersection shader meets the triangles with the arc. Its bend travels in a buffer, because an intersection shader sees
// no payload.
uint payload_launch() {
    return (gl_LaunchIDEXT.z * gl_LaunchSizeEXT.y + gl_LaunchIDEXT.y) * gl_LaunchSizeEXT.x + gl_LaunchIDEXT.x;
}

void payload_bend(Segment segment) {
    if (!GEO_STRAIGHT) io_bends[payload_launch()] = segment.bend;
}

// Indices of miss shaders in the shader binding table.
const uint MISS_PRIMARY = 0u;
const uint MISS_SHADOW = 1u;

// What a hit group's record says: where the primitives of its geometry are in the buffers, and their material.
struct HitRecord {
    uint first;
    uint material;
};

#endif
