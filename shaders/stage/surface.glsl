// The closest-hit stage: moves the path's state to the hit and reads the surface there.
#ifndef SURFACE_GLSL
#define SURFACE_GLSL
#include "stage/walk.glsl"
#include "stage/triangle.glsl"
#include "stage/quadric.glsl"
#include "stage/mask.glsl"
#include "shared/sampling.glsl"

// What shading needs to know of a hit.
struct Surface {
    vec4 normal;     // unit tangent vector on the side of the viewer
    vec3 conormal;   // chart conormal, on the side of the viewer
    vec3 base_color;
    vec3 emission;
    float metallic;
    float roughness;
    uint object;
};

void stage_closest_hit(inout Path path, inout Surface surface, Segment segment, uint reference) {
    float s;
    bool away; // the conormal points away from the viewer
    uint material_index;
    vec2 uv = vec2(0.0);
    if (IO_QUADRICS && (!IO_MESHES || (reference & IO_QUADRIC_BIT) != 0u)) {
        uint index = reference & ~IO_QUADRIC_BIT;
        s = quadric_hit(segment, index, 1.0);
        surface.conormal = quadric_gradient(io_quadric_surfaces[index], segment.origin + s * segment.direction);
        away = dot(surface.conormal, segment.direction) > 0.0;
        material_index = io_quadric_shading[index].material;
        surface.object = io_quadric_shading[index].object;
    } else {
        Triangle triangle = io_triangles[reference];
        TriangleShading shading = io_triangle_shading[reference];
        vec3 hit = triangle_hit(segment, triangle);
        s = hit.x;
        surface.conormal = shading.conormal_a + hit.y * (shading.conormal_b - shading.conormal_a)
            + hit.z * (shading.conormal_c - shading.conormal_a);
        // Which side is seen follows from the plane of the triangle, not from the interpolated normal.
        vec3 plane = cross(triangle.b - triangle.a, triangle.c - triangle.a);
        away = (dot(plane, segment.direction) > 0.0) == (dot(plane, surface.conormal) > 0.0);
        material_index = shading.material;
        surface.object = shading.object;
        uv = mask_uv(shading, hit.yz);
    }

    // The state at the hit, on the geodesic itself.
    Geodesic g = walk_state(path);
    float u = geo_parameter(g, segment.origin + s * segment.direction);
    path.travelled += geo_length(g, u);
    g = geo_advance(g, u);
    path.point = g.point;
    path.velocity = g.velocity;
    path.status = PATH_HIT;

    if (away) surface.conormal = -surface.conormal;
    if (IO_SHADING != IO_SHADING_RIEMANNIAN) return;

    surface.normal = geo_raise(g.point, surface.conormal);
    Material material = io_materials[material_index];
    surface.base_color = material.base_color.rgb;
    surface.emission = material.emission;
    surface.metallic = material.metallic;
    surface.roughness = material.roughness;
    if (IO_TEXTURES && material.base_texture != IO_NONE) {
        surface.base_color *= sampling_bilinear(material.base_texture, uv).rgb;
    }
    if (IO_TEXTURES && material.surface_texture != IO_NONE) {
        vec4 texel = sampling_bilinear(material.surface_texture, uv);
        surface.roughness *= texel.g;
        surface.metallic *= texel.b;
    }
}

#endif
