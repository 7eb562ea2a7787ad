// The whole path of a pixel in one invocation.
#define IO_DISPATCH
#include "trace/compute.glsl"
#include "stage/raygen.glsl"

layout(local_size_x = IO_GROUP_WIDTH * IO_GROUP_HEIGHT) in;

// Invocations in Z-order, so that those which a device runs in lockstep are a block of pixels and not a row.
uvec2 group_pixel(uint i) {
    uvec2 bits = uvec2(i, i >> 1u) & 0x15u;
    bits = (bits | (bits >> 1u)) & 0x13u;
    return (bits | (bits >> 2u)) & 0x07u;
}

void main() {
    uvec3 ray; // column, row, eye
    if (IO_LISTED) {
        uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
        uint index = group * IO_GROUP_WIDTH * IO_GROUP_HEIGHT + gl_LocalInvocationIndex;
        if (index >= io_dispatch.extent.x) return;
        ray = raygen_listed(io_dispatch.origin.x + index);
    } else {
        uvec2 inside_tile = gl_WorkGroupID.xy * uvec2(IO_GROUP_WIDTH, IO_GROUP_HEIGHT) + group_pixel(gl_LocalInvocationIndex);
        if (any(greaterThanEqual(inside_tile, io_dispatch.extent))) return;
        ray = uvec3(io_dispatch.origin + inside_tile, io_dispatch.eye + gl_WorkGroupID.z);
    }
    stage_raygen(ray.xy, ray.z, io_dispatch.offset);
    count_flush();
}
