// The intersection stage of quadrics x^T Q x = 0, x = (chart, 1). In the classical geometries every metric ball
// and every tube around a geodesic is one, so the same few lines are exact for all of them.
#ifndef QUADRIC_GLSL
#define QUADRIC_GLSL
#include "stage/arrays.glsl"
#include "stage/walk.glsl"
#include "stage/triangle.glsl"

// Half of the gradient of x^T Q x at a chart point.
vec3 quadric_gradient(Quadric q, vec3 c) {
    vec4 x = vec4(c, 1.0);
    return q.form0.xyz * dot(q.form0, x) + q.form1.xyz * dot(q.form1, x) + q.form2.xyz * dot(q.form2, x) - q.quadratic * c;
}

bool quadric_clipped(uint index, vec3 c) {
    QuadricShading shading = array_quadric_shading(index);
    vec4 x = vec4(c, 1.0);
    return dot(shading.clip0, x) < 0.0 || dot(shading.clip1, x) < 0.0;
}

// Smallest s in [0, min(1, s_end)] at which the segment meets the surface, or NO_HIT. An eye inside sees the far wall. For
// straight segments: where others are needed there are no quadrics.
float quadric_hit(Segment segment, uint index, float s_end) {
    Quadric quadric = array_quadric(index);
    vec4 x = vec4(segment.origin, 1.0);
    vec3 d = segment.direction;
    vec3 f = vec3(dot(quadric.form0, x), dot(quadric.form1, x), dot(quadric.form2, x));
    vec3 g = vec3(dot(quadric.form0.xyz, d), dot(quadric.form1.xyz, d), dot(quadric.form2.xyz, d));
    float oo = dot(x.xyz, x.xyz);
    float od = dot(x.xyz, d);
    float dd = dot(d, d);
    float ff = dot(f, f);
    float fg = dot(f, g);
    float gg = dot(g, g);
    float k2 = quadric.quadratic;
    float k0 = quadric.constant;
    float a = gg - k2 * dd;
    float b = fg - k2 * od;
    float c = ff - k2 * oo - k0;
    // b^2 - ac with (f.g)^2 - f^2 g^2 replaced by -|f x g|^2: what is left are terms of the size of the result. The
    // textbook form loses the silhouette of a tube of radius r by the rounding of 1/r.
    vec3 moment = cross(f, g);
    float small = gg * (k2 * oo + k0) + k2 * (dd * ff - 2.0 * fg * od) + k2 * (k2 * (od * od - dd * oo) - dd * k0);
    float discriminant = small - dot(moment, moment);
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
