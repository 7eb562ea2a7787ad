// The closest-hit shader of quadrics.
#define COUNT_AT_ONCE
#include "trace/ray.glsl"

layout(location = PAYLOAD) rayPayloadInEXT Payload payload;
layout(shaderRecordEXT, scalar) buffer Record { HitRecord record; };

void main() {
    Segment segment = ray_segment();
    uint index = record.first + gl_PrimitiveID;
    stage_hit_quadric(payload.path, payload.hit, segment, index, io_quadric_shading[index].material);
}
