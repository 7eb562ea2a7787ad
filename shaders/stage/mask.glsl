// The any-hit stage: whether a triangle has a hole where the segment meets it. Only compiled in when a material
// of the scene has an alpha mask.
#ifndef MASK_GLSL
#define MASK_GLSL
#include "shared/io.glsl"
#include "shared/sampling.glsl"

vec2 mask_uv(TriangleShading shading, vec2 weights) {
    return shading.uv_a + weights.x * (shading.uv_b - shading.uv_a) + weights.y * (shading.uv_c - shading.uv_a);
}

bool stage_is_hole(uint triangle, vec2 weights) {
    TriangleShading shading = io_triangle_shading[triangle];
    Material material = io_materials[shading.material];
    if (material.alpha_cutoff < 0.0) return false;
    float alpha = material.base_color.a;
    if (material.base_texture != IO_NONE) alpha *= sampling_bilinear(material.base_texture, mask_uv(shading, weights)).a;
    return alpha < material.alpha_cutoff;
}

#endif
