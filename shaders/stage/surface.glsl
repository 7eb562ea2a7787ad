// What shading needs to know of a surface, from the numbers that a hit brought.
#ifndef SURFACE_GLSL
#define SURFACE_GLSL
#include "stage/hit.glsl"
#include "shared/sampling.glsl"

struct Surface {
    vec4 normal; // unit tangent vector on the side of the viewer
    vec3 base_color;
    vec3 emission;
    float metallic;
    float roughness;
};

Surface surface_at(Path path, Hit hit) {
    Material material = io_materials[hit.material];
    Surface surface = Surface(geo_raise(path.point, hit.conormal), material.base_color.rgb, material.emission,
                              material.metallic, material.roughness);
    if (IO_COORDINATES) {
        vec3 place = material.coordinate_scale * geo_chart(path.point) + material.coordinate_shift;
        surface.base_color *= clamp(place, vec3(0.0), vec3(1.0));
    }
    if (IO_TEXTURES && material.base_texture != IO_NONE) {
        surface.base_color *= sampling_bilinear(material.base_texture, hit.uv).rgb;
    }
    if (IO_TEXTURES && material.surface_texture != IO_NONE) {
        vec4 texel = sampling_bilinear(material.surface_texture, hit.uv);
        surface.roughness *= texel.g;
        surface.metallic *= texel.b;
    }
    return surface;
}

#endif
