// The miss shader of primary rays: it transports the geodesic through the face that it leaves by.
#define COUNT_AT_ONCE
#include "trace/payload.glsl"

layout(location = PAYLOAD) rayPayloadInEXT Payload payload;

void main() {
    stage_miss(payload.path, false);
}
