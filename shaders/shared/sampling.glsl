// Texture lookups. Texels are linear halves in a buffer and are filtered here, so that all backends compute the
// same value; a driver's sampler may round its weights to 8 bits.
#ifndef SAMPLING_GLSL
#define SAMPLING_GLSL
#include "shared/io.glsl"

int sampling_wrap(int i, int n, uint mode) {
    if (mode == IO_WRAP_CLAMP) return clamp(i, 0, n - 1);
    if (mode == IO_WRAP_MIRROR) {
        int j = i - 2 * n * int(floor(float(i) / float(2 * n)));
        return j < n ? j : 2 * n - 1 - j;
    }
    return i - n * int(floor(float(i) / float(n)));
}

vec4 sampling_texel(Texture texture_info, ivec2 at) {
    int x = sampling_wrap(at.x, int(texture_info.width), texture_info.wrap_u);
    int y = sampling_wrap(at.y, int(texture_info.height), texture_info.wrap_v);
    uvec2 packed = io_texels[texture_info.first + uint(y) * texture_info.width + uint(x)];
    return vec4(unpackHalf2x16(packed.x), unpackHalf2x16(packed.y));
}

// Bilinear lookup. Coordinates are taken modulo 64 repeats first, so that absurd ones stay in range of integers.
vec4 sampling_bilinear(uint index, vec2 uv) {
    Texture texture_info = io_texture_table[index];
    uv -= 64.0 * floor(uv * (1.0 / 64.0));
    vec2 at = uv * vec2(texture_info.width, texture_info.height) - 0.5;
    vec2 corner = floor(at);
    vec2 part = at - corner;
    ivec2 i = ivec2(corner);
    vec4 above = mix(sampling_texel(texture_info, i), sampling_texel(texture_info, i + ivec2(1, 0)), part.x);
    vec4 below = mix(sampling_texel(texture_info, i + ivec2(0, 1)), sampling_texel(texture_info, i + ivec2(1, 1)), part.x);
    return mix(above, below, part.y);
}

#endif
