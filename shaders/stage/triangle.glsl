// Where a segment meets a triangle. Traversal and the closest-hit stage call the same function, so that every
// backend computes the same hit from the same primitive.
#ifndef TRIANGLE_GLSL
#define TRIANGLE_GLSL
#include "stage/walk.glsl"

const float NO_HIT = 2.0;

// (s, weight of b, weight of c), or s = NO_HIT. Edge products are antisymmetric to the last bit, so two triangles
// that share an edge leave no gap: one of them contains every segment that passes it.
vec3 triangle_hit(Segment segment, Triangle triangle) {
    precise vec3 a = triangle.a - segment.origin;
    precise vec3 b = triangle.b - segment.origin;
    precise vec3 c = triangle.c - segment.origin;
    precise float wa = dot(segment.direction, cross(b, c));
    precise float wb = dot(segment.direction, cross(c, a));
    precise float wc = dot(segment.direction, cross(a, b));
    if (min(wa, min(wb, wc)) < 0.0 && max(wa, max(wb, wc)) > 0.0) return vec3(NO_HIT);
    float sum = wa + wb + wc;
    vec3 normal = cross(b - a, c - a);
    float rate = dot(normal, segment.direction);
    if (sum == 0.0 || rate == 0.0) return vec3(NO_HIT);
    float s = dot(normal, a) / rate;
    return s >= 0.0 && s <= 1.0 ? vec3(s, wb / sum, wc / sum) : vec3(NO_HIT);
}

// Height of a chart point over the triangle's plane, in units of 1 / (twice its area).
float triangle_form(Triangle triangle, vec3 at) {
    return dot(cross(triangle.b - triangle.a, triangle.c - triangle.a), at - triangle.a);
}

// Weights of the second and third corner of a point of the triangle's plane, clamped to the triangle.
vec2 triangle_weights(Triangle triangle, vec3 at) {
    vec3 b = triangle.b - triangle.a;
    vec3 c = triangle.c - triangle.a;
    vec3 normal = cross(b, c);
    float area = dot(normal, normal);
    if (area == 0.0) return vec2(0.0);
    float wb = clamp(dot(normal, cross(at - triangle.a, c)) / area, 0.0, 1.0);
    float wc = clamp(dot(normal, cross(b, at - triangle.a)) / area, 0.0, 1.0 - wb);
    return vec2(wb, wc);
}

#endif
