// The miss shader of shadow rays.
#define COUNT_AT_ONCE
#include "trace/payload.glsl"

layout(location = PAYLOAD) rayPayloadInEXT Payload payload;

void main() {
    payload.path.status = PATH_FLYING;
    stage_miss(payload.path, true);
}
