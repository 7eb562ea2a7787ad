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

// Height of the curve's point at parameter u over a triangle's plane.
float hit_height(Path path, float u, vec3 normal, vec3 corner) {
    return dot(normal, geo_chart(walk_along(path, u).point) - corner);
}

// Curve parameter at which the geodesic meets the triangle that its segment meets at s: secant steps, the first one with
// the slope along the arc, inside the segment's range; the best of all steps (src/render/cpu/surface.rs, refine).
float hit_refined(Path path, Segment segment, Triangle triangle, float s) {
    vec3 normal = cross(triangle.b - triangle.a, triangle.c - triangle.a);
    float slope = dot(normal, segment_tangent(segment, s)) / path.u_end;
    float u = clamp(s * path.u_end, 0.0, path.u_end);
    float off = hit_height(path, u, normal, triangle.a);
    float best_u = u;
    float best_off = abs(off);
    for (uint i = 0u; i < HIT_REFINE_STEPS; i++) {
        if (off == 0.0 || slope == 0.0) break;
        float next = clamp(u - off / slope, 0.0, path.u_end);
        float off_next = hit_height(path, next, normal, triangle.a);
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
void hit_arrive(inout Path path, float u) {
    path.travelled += geo_length(walk_state(path), u);
    walk_set(path, walk_along(path, u));
    path.status = PATH_HIT;
}

void stage_hit_triangle(inout Path path, out Hit hit, Segment segment, uint index, uint material) {
    Triangle triangle = io_triangles[index];
    TriangleShading shading = io_triangle_shading[index];
    vec3 solution = GEO_STRAIGHT ? triangle_solve(segment, triangle) : triangle_hit(segment, triangle);
    float s = clamp(solution.x, 0.0, 1.0);
    if (GEO_STRAIGHT) {
        hit_arrive(path, geo_parameter(walk_state(path), segment_at(segment, s)));
    } else {
        hit_arrive(path, hit_refined(path, segment, triangle, s));
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
    vec3 at = segment_at(segment, clamp(quadric_hit(segment, index, 1.0), 0.0, 1.0));
    hit_arrive(path, geo_parameter(walk_state(path), at));
    vec3 conormal = quadric_gradient(io_quadric_surfaces[index], at);
    bool away = dot(conormal, segment.direction) > 0.0;
    hit = Hit(away ? -conormal : conormal, vec2(0.0), material, io_quadric_shading[index].object);
}

#endif
