// The miss shader of shadow rays.
#define COUNT_AT_ONCE
#include "trace/payload.glsl"

layout(location = PAYLOAD_SHADOW) rayPayloadInEXT Path payload;

void main() {
    payload.status = PATH_FLYING;
    stage_transport(payload, IO_SHADOW_BOUNCES, true);
}
