// The miss shader of the pieces of an arc that are not its last.
#define COUNT_AT_ONCE
#include "trace/payload.glsl"

layout(location = PAYLOAD) rayPayloadInEXT Payload payload;

void main() {
    payload.path.status = PATH_FLYING;
}
