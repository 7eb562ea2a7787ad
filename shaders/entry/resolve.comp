// Pixels of a headset's eyes, as the images of its runtime want them: what has no ray is filled in, colours are encoded,
// distances become depths.
#define IO_RESOLVE
#include "shared/io.glsl"
#include "shared/math.glsl"

layout(local_size_x = IO_GROUP_WIDTH, local_size_y = IO_GROUP_HEIGHT) in;

vec4 resolve_pixel(uvec2 at, uint eye) {
    return io_pixels[(eye * io_resolve.size.y + at.y) * io_resolve.size.x + at.x];
}

// A pixel between pixels that have rays: their colours, weighted by nearness, and the distance of the heaviest.
vec4 resolve_between(uvec2 at, uint eye, uint rate) {
    uvec2 low = at / rate * rate;
    vec2 share = vec2(at - low) / float(rate);
    vec3 color = vec3(0.0);
    float total = 0.0;
    float heaviest = 0.0;
    float range = 0.0;
    for (uint i = 0u; i < 4u; i++) {
        uvec2 corner = low + rate * uvec2(i & 1u, i >> 1u);
        if (any(greaterThanEqual(corner, io_resolve.size))) continue;
        vec4 traced = resolve_pixel(corner, eye);
        // The next square may have fewer rays.
        if (traced.w == 0.0) continue;
        float weight = ((i & 1u) == 1u ? share.x : 1.0 - share.x) * ((i >> 1u) == 1u ? share.y : 1.0 - share.y);
        color += weight * traced.rgb;
        total += weight;
        if (weight > heaviest) {
            heaviest = weight;
            range = traced.w;
        }
    }
    return total > 0.0 ? vec4(color / total, range) : vec4(0.0);
}

vec3 resolve_srgb(vec3 linear) {
    bvec3 small = lessThanEqual(linear, vec3(0.0031308));
    return mix(1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055, 12.92 * linear, small);
}

void main() {
    uvec2 at = gl_GlobalInvocationID.xy;
    uint eye = gl_WorkGroupID.z;
    if (any(greaterThanEqual(at, io_resolve.size))) return;
    uvec2 tiles = (io_resolve.size + IO_RATE_TILE - 1u) / IO_RATE_TILE;
    uint rate = 1u;
    if (io_resolve.sparse != 0u) rate = io_rates[(eye * tiles.y + at.y / IO_RATE_TILE) * tiles.x + at.x / IO_RATE_TILE];
    vec4 pixel = rate > 1u ? resolve_between(at, eye, rate) : resolve_pixel(at, eye);

    uint index = (eye * io_resolve.size.y + at.y) * io_resolve.size.x + at.x;
    vec3 unit = clamp(pixel.rgb, 0.0, 1.0);
    switch (io_resolve.encoding) {
        case IO_ENCODING_RGBA8_SRGB: io_packed[index] = packUnorm4x8(vec4(resolve_srgb(unit), 1.0)); break;
        case IO_ENCODING_BGRA8_SRGB: io_packed[index] = packUnorm4x8(vec4(resolve_srgb(unit.bgr), 1.0)); break;
        case IO_ENCODING_RGBA8: io_packed[index] = packUnorm4x8(vec4(unit, 1.0)); break;
        case IO_ENCODING_BGRA8: io_packed[index] = packUnorm4x8(vec4(unit.bgr, 1.0)); break;
        case IO_ENCODING_RGBA16F:
            io_packed[2u * index] = packHalf2x16(min(pixel.rg, 65504.0));
            io_packed[2u * index + 1u] = packHalf2x16(vec2(min(pixel.b, 65504.0), 1.0));
            break;
        case IO_ENCODING_RGBA16:
            io_packed[2u * index] = packUnorm2x16(unit.rg);
            io_packed[2u * index + 1u] = packUnorm2x16(vec2(unit.b, 1.0));
            break;
    }
    if (io_resolve.unit > 0.0) {
        // Depth along the view axis, as if the geodesic were a straight line of its length: 0 at the near plane, 1 at infinity.
        vec4 tangents = io_view[eye].tangents;
        vec2 share = (vec2(at) + 0.5) / vec2(io_resolve.size);
        vec2 slope = vec2(mix(tangents.x, tangents.y, share.x), mix(tangents.w, tangents.z, share.y));
        float z = pixel.w * io_resolve.unit * inversesqrt(1.0 + dot(slope, slope));
        // What has no ray is hidden from view: it is put far away.
        io_depths[index] = pixel.w > 0.0 ? clamp(1.0 - io_resolve.near / max(z, io_resolve.near), 0.0, 1.0) : 1.0;
    }
}
