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

const uint HIT_REFINE_STEPS = 4u;

// Whether segments are the geodesics themselves.
const bool HIT_STRAIGHT = GEO_STRAIGHT && IO_INTEGRATOR == IO_INTEGRATOR_EXACT;

// The step of the integrator that the path is on; nothing where rays follow the geometry's own flow.
Dense hit_step(Path path) {
    Dense dense;
    if (IO_INTEGRATOR != IO_INTEGRATOR_EXACT) dense = integrate_step(IO_INTEGRATOR, stepped_state(path), path.velocity.w);
    return dense;
}

// Height of the curve's point at parameter u over a plane of the chart.
float hit_height(Path path, Dense dense, float u, vec3 normal, vec3 corner) {
    if (IO_INTEGRATOR != IO_INTEGRATOR_EXACT) return dot(normal, dense_nested(dense.c, u / dense.h) - corner);
    return dot(normal, geo_chart(walk_along(path, u).point) - corner);
}

// Curve parameter at which the geodesic meets the plane of the triangle that its segment meets at s: secant steps, the first one with
// the slope along the arc, inside the segment's range; the best of all steps (src/render/cpu/surface.rs, refine).
float hit_refined(Path path, Dense dense, Segment segment, vec3 normal, vec3 corner, float s) {
    float slope = dot(normal, segment_tangent(segment, s)) / path.u_end;
    float u = clamp(s * path.u_end, 0.0, path.u_end);
    float off = hit_height(path, dense, u, normal, corner);
    float best_u = u;
    float best_off = abs(off);
    for (uint i = 0u; i < HIT_REFINE_STEPS; i++) {
        if (off == 0.0 || slope == 0.0) break;
        float next = clamp(u - off / slope, 0.0, path.u_end);
        float off_next = hit_height(path, dense, next, normal, corner);
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

// Moves the path's state to curve parameter u, the hit.
void hit_arrive(inout Path path, Dense dense, float u) {
    path.status = PATH_HIT;
    if (IO_INTEGRATOR == IO_INTEGRATOR_EXACT) {
        path.travelled += geo_length(walk_state(path), u);
        walk_set(path, walk_along(path, u));
    } else {
        path.travelled += u;
        walk_set(path, geo_restore(integrate_geodesic(dense_at(dense, u / dense.h))));
        if (any(isnan(path.point + path.velocity))) path.status = PATH_GONE;
    }
}

// The triangle that traversal names: for compute one of a pair.
Triangle hit_triangle(uint name) {
#ifdef WALK_TOGETHER
    Triangle pair = array_pair(name / 2u);
    return (name & 1u) == 0u ? pair : pair_second(pair);
#else
    return io_triangles[name];
#endif
}

void stage_hit_triangle(inout Path path, out Hit hit, Segment segment, uint index, uint material) {
    Triangle triangle = hit_triangle(index);
    TriangleShading shading = io_triangle_shading[index];
    vec3 solution = GEO_STRAIGHT ? triangle_solve(segment, triangle) : triangle_hit_arc(segment, triangle);
    float s = clamp(solution.x, 0.0, 1.0);
    Dense dense = hit_step(path);
    if (HIT_STRAIGHT) {
        hit_arrive(path, dense, geo_parameter(walk_state(path), segment_at(segment, s)));
    } else {
        vec3 normal = cross(triangle.b - triangle.a, triangle.c - triangle.a);
        hit_arrive(path, dense, hit_refined(path, dense, segment, normal, triangle.a, s));
    }
    vec2 weights = GEO_STRAIGHT ? solution.yz : triangle_weights(triangle, geo_chart(path.point));
    vec3 conormal = shading.conormal_a + weights.x * (shading.conormal_b - shading.conormal_a)
        + weights.y * (shading.conormal_c - shading.conormal_a);
    // Which side is seen follows from the plane of the triangle, not from the interpolated normal.
    vec3 plane = cross(triangle.b - triangle.a, triangle.c - triangle.a);
    bool away = (dot(plane, segment_tangent(segment, s)) > 0.0) == (dot(plane, conormal) > 0.0);
    hit = Hit(away ? -conormal : conormal, mask_uv(shading, weights), material, shading.object);
}

void stage_hit_quadric(inout Path path, out Hit hit, Segment segment, uint index, uint material) {
    float s = clamp(quadric_hit(segment, index, 1.0), 0.0, 1.0);
    vec3 at = segment_at(segment, s);
    Dense dense = hit_step(path);
    // By an integrator the point that the segment meets is where the curve passes the plane through it, across.
    hit_arrive(path, dense, HIT_STRAIGHT ? geo_parameter(walk_state(path), at)
                                         : hit_refined(path, dense, segment, segment.direction, at, s));
    vec3 conormal = quadric_gradient(io_quadric_surfaces[index], at);
    bool away = dot(conormal, segment.direction) > 0.0;
    hit = Hit(away ? -conormal : conormal, vec2(0.0), material, io_quadric_shading[index].object);
}

#endif
