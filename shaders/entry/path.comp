// The whole path of a pixel in one invocation.
#define IO_DISPATCH
#include "trace/compute.glsl"
#include "stage/raygen.glsl"

layout(local_size_x = IO_GROUP_WIDTH, local_size_y = IO_GROUP_HEIGHT) in;

void main() {
    uvec2 inside_tile = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(inside_tile, io_dispatch.extent))) return;
    stage_raygen(io_dispatch.origin + inside_tile, io_dispatch.offset);
    count_flush();
}
