// The closest-hit stages: they move the path's state to the hit and say which surface is there, in few numbers,
// because the ray tracing pipeline carries them back to raygen (28 bytes).
#ifndef HIT_GLSL
#define HIT_GLSL
#include "stage/walk.glsl"
#include "stage/triangle.glsl"
#include "stage/quadric.glsl"
#include "stage/mask.glsl"

struct Hit {
    vec3 conormal; // chart conormal, on the side of the viewer
    vec2 uv;
    uint material;
    uint object;
};

// What vanishes on a primitive's surface.
float hit_form(bool is_quadric, uint index, vec3 at) {
    return is_quadric ? quadric_form(io_quadric_surfaces[index], at) : triangle_form(io_triangles[index], at);
}

// Whether segments are the geodesics themselves.
const bool HIT_STRAIGHT = GEO_STRAIGHT && IO_INTEGRATOR == IO_INTEGRATOR_EXACT;

// The step of the integrator that the path is on; nothing where rays follow the geometry's own flow.
Dense hit_step(Path path) {
    Dense dense;
    if (IO_INTEGRATOR != IO_INTEGRATOR_EXACT) dense = integrate_step(IO_INTEGRATOR, stepped_state(path), path.velocity.w);
    return dense;
}

// The curve's chart point at parameter u.
vec3 hit_curve(Path path, Dense dense, float u) {
    if (IO_INTEGRATOR != IO_INTEGRATOR_EXACT) return dense_nested(dense.c, u / dense.h);
    return geo_chart(geo_advance(walk_state(path), u).point);
}

const uint HIT_REFINE_STEPS = 4u;

// Curve parameter at which the geodesic meets the primitive that its chord meets at s: secant steps, the first one with
// the slope along the chord, inside the chord's range; the best of all steps (src/render/cpu/surface.rs, refine).
float hit_refined(Path path, Dense dense, Segment segment, bool is_quadric, uint index, float s) {
    float along0 = hit_form(is_quadric, index, segment.origin + (s - 0.01) * segment.direction);
    float along1 = hit_form(is_quadric, index, segment.origin + (s + 0.01) * segment.direction);
    float slope = (along1 - along0) / (0.02 * path.u_end);
    float u = clamp(s * path.u_end, 0.0, path.u_end);
    float off = hit_form(is_quadric, index, hit_curve(path, dense, u));
    float best_u = u;
    float best_off = abs(off);
    for (uint i = 0u; i < HIT_REFINE_STEPS; i++) {
        if (off == 0.0 || slope == 0.0) break;
        float next = clamp(u - off / slope, 0.0, path.u_end);
        float off_next = hit_form(is_quadric, index, hit_curve(path, dense, next));
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

// Moves the path's state to the hit, on the geodesic itself. Returns the chart point of the hit: on the segment where
// geodesics are straight in the chart, else on the curve.
vec3 hit_arrive(inout Path path, Segment segment, bool is_quadric, uint index, float s) {
    Geodesic g = walk_state(path);
    Dense dense = hit_step(path);
    vec3 at = segment.origin + clamp(s, 0.0, 1.0) * segment.direction;
    float u = HIT_STRAIGHT ? geo_parameter(g, at) : hit_refined(path, dense, segment, is_quadric, index, clamp(s, 0.0, 1.0));
    if (IO_INTEGRATOR == IO_INTEGRATOR_EXACT) {
        path.travelled += geo_length(g, u);
        g = geo_advance(g, u);
    } else {
        path.travelled += u;
        g = geo_restore(integrate_geodesic(dense_at(dense, u / dense.h)));
    }
    path.point = g.point;
    path.velocity = g.velocity;
    path.status = any(isnan(g.point + g.velocity)) ? PATH_GONE : PATH_HIT;
    return HIT_STRAIGHT ? at : geo_chart(g.point);
}

void stage_hit_triangle(inout Path path, out Hit hit, Segment segment, uint index, uint material) {
    Triangle triangle = io_triangles[index];
    TriangleShading shading = io_triangle_shading[index];
    vec3 solution = triangle_solve(segment, triangle);
    vec3 at = hit_arrive(path, segment, false, index, solution.x);
    vec2 weights = HIT_STRAIGHT ? solution.yz : triangle_weights(triangle, at);
    vec3 conormal = shading.conormal_a + weights.x * (shading.conormal_b - shading.conormal_a)
        + weights.y * (shading.conormal_c - shading.conormal_a);
    // Which side is seen follows from the plane of the triangle, not from the interpolated normal.
    vec3 plane = cross(triangle.b - triangle.a, triangle.c - triangle.a);
    bool away = (dot(plane, segment.direction) > 0.0) == (dot(plane, conormal) > 0.0);
    hit = Hit(away ? -conormal : conormal, mask_uv(shading, weights), material, shading.object);
}

void stage_hit_quadric(inout Path path, out Hit hit, Segment segment, uint index, uint material) {
    vec3 at = hit_arrive(path, segment, true, index, quadric_hit(segment, index, 1.0));
    vec3 conormal = quadric_gradient(io_quadric_surfaces[index], at);
    bool away = dot(conormal, segment.direction) > 0.0;
    hit = Hit(away ? -conormal : conormal, vec2(0.0), material, io_quadric_shading[index].object);
}

#endif
