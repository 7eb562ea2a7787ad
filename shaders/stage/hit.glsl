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

// The state at the hit, on the geodesic itself.
void hit_arrive(inout Path path, vec3 at) {
    Geodesic g = walk_state(path);
    float u = geo_parameter(g, at);
    path.travelled += geo_length(g, u);
    g = geo_advance(g, u);
    path.point = g.point;
    path.velocity = g.velocity;
    path.status = PATH_HIT;
}

void stage_hit_triangle(inout Path path, out Hit hit, Segment segment, uint index, uint material) {
    Triangle triangle = io_triangles[index];
    TriangleShading shading = io_triangle_shading[index];
    vec3 solution = triangle_solve(segment, triangle);
    vec2 weights = solution.yz;
    vec3 conormal = shading.conormal_a + weights.x * (shading.conormal_b - shading.conormal_a)
        + weights.y * (shading.conormal_c - shading.conormal_a);
    // Which side is seen follows from the plane of the triangle, not from the interpolated normal.
    vec3 plane = cross(triangle.b - triangle.a, triangle.c - triangle.a);
    bool away = (dot(plane, segment.direction) > 0.0) == (dot(plane, conormal) > 0.0);
    hit = Hit(away ? -conormal : conormal, mask_uv(shading, weights), material, shading.object);
    hit_arrive(path, segment.origin + clamp(solution.x, 0.0, 1.0) * segment.direction);
}

void stage_hit_quadric(inout Path path, out Hit hit, Segment segment, uint index, uint material) {
    vec3 at = segment.origin + clamp(quadric_hit(segment, index, 1.0), 0.0, 1.0) * segment.direction;
    vec3 conormal = quadric_gradient(io_quadric_surfaces[index], at);
    bool away = dot(conormal, segment.direction) > 0.0;
    hit = Hit(away ? -conormal : conormal, vec2(0.0), material, io_quadric_shading[index].object);
    hit_arrive(path, at);
}

#endif
