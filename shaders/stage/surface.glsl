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

bool surface_is_quadric(uint reference) {
    return IO_QUADRICS && (!IO_MESHES || (reference & IO_QUADRIC_BIT) != 0u);
}

// What vanishes on a primitive's surface.
float surface_form(uint reference, vec3 at) {
    if (surface_is_quadric(reference)) return quadric_form(io_quadric_surfaces[reference & ~IO_QUADRIC_BIT], at);
    return triangle_form(io_triangles[reference], at);
}

const uint SURFACE_REFINE_STEPS = 4u;

// Curve parameter at which the geodesic meets the primitive that its chord meets at s: secant steps, the first one with
// the slope along the chord, inside the chord's range; the best of all steps (src/render/cpu/surface.rs, refine).
float surface_refined(Path path, Segment segment, uint reference, float s) {
    Geodesic g = walk_state(path);
    float along0 = surface_form(reference, segment.origin + (s - 0.01) * segment.direction);
    float along1 = surface_form(reference, segment.origin + (s + 0.01) * segment.direction);
    float slope = (along1 - along0) / (0.02 * path.u_end);
    float u = clamp(s * path.u_end, 0.0, path.u_end);
    float off = surface_form(reference, geo_chart(geo_advance(g, u).point));
    float best_u = u;
    float best_off = abs(off);
    for (uint i = 0u; i < SURFACE_REFINE_STEPS; i++) {
        if (off == 0.0 || slope == 0.0) break;
        float next = clamp(u - off / slope, 0.0, path.u_end);
        float off_next = surface_form(reference, geo_chart(geo_advance(g, next).point));
        if (next == u || isnan(off_next)) break;
        slope = (off_next - off) / (next - u);
        u = next;
        off = off_next;
        if (abs(off) < best_off) {
            best_u = u;
            best_off = abs(off);
        }
    }
    return best_u;
}

void stage_closest_hit(inout Path path, inout Surface surface, Segment segment, uint reference) {
    bool is_quadric = surface_is_quadric(reference);
    vec3 hit = is_quadric ? vec3(quadric_hit(segment, reference & ~IO_QUADRIC_BIT, 1.0), 0.0, 0.0)
                          : triangle_hit(segment, io_triangles[reference]);

    // The state at the hit, on the geodesic itself.
    Geodesic g = walk_state(path);
    vec3 at = segment.origin + hit.x * segment.direction;
    float u = GEO_STRAIGHT ? geo_parameter(g, at) : surface_refined(path, segment, reference, hit.x);
    path.travelled += geo_length(g, u);
    g = geo_advance(g, u);
    path.point = g.point;
    path.velocity = g.velocity;
    path.status = PATH_HIT;
    if (!GEO_STRAIGHT) at = geo_chart(g.point);

    bool away; // the conormal points away from the viewer
    uint material_index;
    vec2 uv = vec2(0.0);
    if (is_quadric) {
        uint index = reference & ~IO_QUADRIC_BIT;
        surface.conormal = quadric_gradient(io_quadric_surfaces[index], at);
        away = dot(surface.conormal, segment.direction) > 0.0;
        material_index = io_quadric_shading[index].material;
        surface.object = io_quadric_shading[index].object;
    } else {
        Triangle triangle = io_triangles[reference];
        TriangleShading shading = io_triangle_shading[reference];
        vec2 weights = GEO_STRAIGHT ? hit.yz : triangle_weights(triangle, at);
        surface.conormal = shading.conormal_a + weights.x * (shading.conormal_b - shading.conormal_a)
            + weights.y * (shading.conormal_c - shading.conormal_a);
        // Which side is seen follows from the plane of the triangle, not from the interpolated normal.
        vec3 plane = cross(triangle.b - triangle.a, triangle.c - triangle.a);
        away = (dot(plane, segment.direction) > 0.0) == (dot(plane, surface.conormal) > 0.0);
        material_index = shading.material;
        surface.object = shading.object;
        uv = mask_uv(shading, weights);
    }

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
