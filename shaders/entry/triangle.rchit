// The closest-hit shader of meshes.
#define COUNT_AT_ONCE
#include "trace/ray.glsl"

layout(location = PAYLOAD) rayPayloadInEXT Payload payload;
layout(shaderRecordEXT, scalar) buffer Record { HitRecord record; };

void main() {
    Segment segment = ray_segment();
    stage_hit_triangle(payload.path, payload.hit, segment, record.first + gl_PrimitiveID, record.material);
}
