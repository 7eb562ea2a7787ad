// The intersection stage of quadrics x^T Q x = 0, x = (chart, 1). In the classical geometries every metric ball
// and every tube around a geodesic is one, so the same few lines are exact for all of them.
#ifndef QUADRIC_GLSL
#define QUADRIC_GLSL
#include "stage/walk.glsl"
#include "stage/triangle.glsl"

bool quadric_clipped(Quadric quadric, Segment segment, float s) {
    vec4 x = vec4(segment.origin + s * segment.direction, 1.0);
    return dot(quadric.clip0, x) < 0.0 || dot(quadric.clip1, x) < 0.0;
}

// Smallest s in [0, 1] at which the segment meets the surface, or NO_HIT. An eye inside sees the far wall.
float quadric_hit(Segment segment, Quadric quadric) {
    vec4 x = vec4(segment.origin, 1.0);
    vec4 d = vec4(segment.direction, 0.0);
    vec4 qd = quadric.form * d;
    float a = dot(d, qd);
    float b = dot(x, qd);
    float c = dot(x, quadric.form * x);
    float discriminant = b * b - a * c;
    if (discriminant < 0.0) return NO_HIT;
    // The root that does not cancel, and the other from the product of both.
    float q = -(b + (b < 0.0 ? -1.0 : 1.0) * sqrt(discriminant));
    float s0 = q == 0.0 ? NO_HIT : c / q;
    float s1 = a == 0.0 ? NO_HIT : q / a;
    float near = min(s0, s1);
    float far = max(s0, s1);
    if (near >= 0.0 && near <= 1.0 && !quadric_clipped(quadric, segment, near)) return near;
    if (far >= 0.0 && far <= 1.0 && !quadric_clipped(quadric, segment, far)) return far;
    return NO_HIT;
}

#endif
