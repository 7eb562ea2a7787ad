#define IO_DISPATCH
#include "shared/io.glsl"
#include "shared/math.glsl"
#include "shared/types.glsl"
#include "GEOMETRY"

layout(local_size_x = IO_GROUP_WIDTH, local_size_y = IO_GROUP_HEIGHT) in;

void main() {
}
