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

// Where the arc in flight is kept (trace/pieces.glsl): in a buffer, because an intersection shader sees no payload.
uint payload_launch() {
    return (gl_LaunchIDEXT.z * gl_LaunchSizeEXT.y + gl_LaunchIDEXT.y) * gl_LaunchSizeEXT.x + gl_LaunchIDEXT.x;
}

// Indices of miss shaders in the shader binding table.
const uint MISS_PRIMARY = 0u;
const uint MISS_PIECE = 1u;
const uint MISS_SHADOW = GEO_STRAIGHT ? 1u : 2u;

// What a hit group's record says: where the primitives of its geometry are in the buffers, and their material.
struct HitRecord {
    uint first;
    uint material;
};

#endif
