// The closest-hit shader of quadrics.
#define COUNT_AT_ONCE
#include "trace/payload.glsl"

layout(location = PAYLOAD_PRIMARY) rayPayloadInEXT Payload payload;
layout(shaderRecordEXT, scalar) buffer Record { HitRecord record; };

void main() {
    Segment segment = Segment(gl_WorldRayOriginEXT, gl_WorldRayDirectionEXT);
    stage_hit_quadric(payload.path, payload.hit, segment, record.first + gl_PrimitiveID, record.material);
}
