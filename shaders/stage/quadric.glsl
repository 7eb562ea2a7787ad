// The intersection stage of quadrics x^T Q x = 0, x = (chart, 1). In the classical geometries every metric ball
// and every tube around a geodesic is one, so the same few lines are exact for all of them.
#ifndef QUADRIC_GLSL
#define QUADRIC_GLSL
#include "stage/walk.glsl"
#include "stage/triangle.glsl"

// The quadratic part times a vector.
vec3 quadric_times(Quadric q, vec3 v) {
    return q.diagonal * v + q.mixed.zxy * v.yzx + q.mixed.yzx * v.zxy;
}

// Half of the gradient of x^T Q x at a chart point.
vec3 quadric_gradient(Quadric q, vec3 c) {
    return quadric_times(q, c) + q.linear;
}

bool quadric_clipped(uint index, vec3 c) {
    QuadricShading shading = io_quadric_shading[index];
    vec4 x = vec4(c, 1.0);
    return dot(shading.clip0, x) < 0.0 || dot(shading.clip1, x) < 0.0;
}

// Smallest s in [0, min(1, s_end)] at which the segment meets the surface, or NO_HIT. An eye inside sees the far wall.
float quadric_hit(Segment segment, uint index, float s_end) {
    Quadric quadric = io_quadric_surfaces[index];
    vec3 qd = quadric_times(quadric, segment.direction);
    float a = dot(segment.direction, qd);
    float b = dot(segment.origin, qd) + dot(quadric.linear, segment.direction);
    float c = dot(segment.origin, quadric_gradient(quadric, segment.origin) + quadric.linear) + quadric.constant;
    float discriminant = b * b - a * c;
    if (discriminant < 0.0) return NO_HIT;
    // The root that does not cancel, and the other from the product of both.
    float q = -(b + (b < 0.0 ? -1.0 : 1.0) * sqrt(discriminant));
    float s0 = q == 0.0 ? NO_HIT : c / q;
    float s1 = a == 0.0 ? NO_HIT : q / a;
    float near = min(s0, s1);
    float far = max(s0, s1);
    float last = min(s_end, 1.0);
    if (near >= 0.0 && near <= last && !quadric_clipped(index, segment.origin + near * segment.direction)) return near;
    if (far >= 0.0 && far <= last && !quadric_clipped(index, segment.origin + far * segment.direction)) return far;
    return NO_HIT;
}

#endif
