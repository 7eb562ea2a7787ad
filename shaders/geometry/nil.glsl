// Nil, the Heisenberg group. Twin, with the theory: src/geometry/nil.rs. Contract: e3.glsl.
//
// Points (x, y, z, 1), product (x,y,z)(x',y',z') = (x+x', y+y', z+z'+xy'); vectors are components in the
// left-invariant frame. The horizontal part of a velocity turns at the rate w; curve parameter arc length.
#include "shared/passage.glsl"

const bool GEO_STRAIGHT = false;

vec3 nil_product(vec3 a, vec3 b) {
    return a + b + vec3(0.0, 0.0, a.x * b.y);
}

// p^-1 q.
vec3 nil_displacement(vec3 p, vec3 q) {
    vec3 d = q - p;
    return vec3(d.xy, d.z - p.x * d.y);
}

// v turned by the angle with this (sin, cos).
vec2 nil_rotate(vec2 v, vec2 sc) {
    return vec2(v.x * sc.y - v.y * sc.x, v.x * sc.x + v.y * sc.y);
}

float nil_sine_ratio(float x) {
    return abs(x) < 1e-2 ? 1.0 - x * x * (1.0 / 6.0) : m_sincos(x).x / x;
}

// (x - sin x) / x^3, from 1/6 at 0.
float nil_fall(float x) {
    float z = x * x;
    if (z > 1.0) return (x - m_sincos(x).x) / (x * z);
    return 1.66666667e-1 - z * (8.33333333e-3 - z * (1.98412698e-4 - z * (2.75573192e-6 - z * 2.50521084e-8)));
}

// arctan(w y) / w.
float nil_arc_over_rate(float y, float w) {
    float x = w * y;
    return abs(x) < 2e-2 ? y * (1.0 - x * x * (1.0 / 3.0)) : m_atan(x, 1.0) / w;
}

vec4 geo_base() {
    return vec4(0.0, 0.0, 0.0, 1.0);
}

float geo_inner(vec4 p, vec4 u, vec4 v) {
    return dot(u.xyz, v.xyz);
}

Geodesic geo_flow(Geodesic g, float t) {
    vec2 horizontal = g.velocity.xy;
    float theta = g.velocity.z * t;
    vec2 way = nil_rotate(horizontal, m_sincos(0.5 * theta)) * (t * nil_sine_ratio(0.5 * theta));
    float symmetric = theta * (1.0 + 0.5 * dot(horizontal, horizontal) * t * t * nil_fall(theta));
    vec3 point = nil_product(g.point.xyz, vec3(way, symmetric + 0.5 * way.x * way.y));
    return Geodesic(vec4(point, 1.0), vec4(nil_rotate(horizontal, m_sincos(theta)), g.velocity.z, 0.0));
}

// F(h) and F'(h) of the twin's geo_log.
vec2 nil_fibre(float h, float square) {
    float s = nil_sine_ratio(h);
    float share = nil_fall(2.0 * h) / (s * s);
    return vec2(2.0 * h + square * h * share, 2.0 + square * (0.5 - 2.0 * share * m_sincos(h).y / s));
}

vec4 geo_log(vec4 p, vec4 q, out float length_out) {
    vec3 way = nil_displacement(p.xyz, q.xyz);
    float symmetric = way.z - 0.5 * way.x * way.y;
    float rise = abs(symmetric);
    float square = dot(way.xy, way.xy);
    // Newton's method on F^(-1/2), inside a bracket that ends short of the pole.
    float low = 0.0;
    float high = min(rise / (2.0 + square * (1.0 / 6.0)), 3.14159);
    float h = high;
    for (int i = 0; i < 24 && rise > 0.0; i++) {
        vec2 f = nil_fibre(h, square);
        if (f.x > rise) high = h; else low = h;
        float newton = h + 2.0 * f.x * (1.0 - sqrt(f.x / rise)) / f.y;
        float next = newton > low && newton < high ? newton : 0.5 * (low + high);
        if (abs(next - h) <= 1e-7 * h) break;
        h = next;
    }
    float horizontal = h < M_HALF_PI
        ? sqrt(square) / nil_sine_ratio(h)
        : sqrt(max(rise - 2.0 * h, 0.0) / (nil_fall(2.0 * h) * h));
    length_out = length(vec2(2.0 * h, horizontal));
    if (length_out == 0.0) return vec4(1.0, 0.0, 0.0, 0.0);
    float turn = symmetric < 0.0 ? -1.0 : 1.0;
    vec2 away = square > 0.0 ? way.xy * inversesqrt(square) : vec2(1.0, 0.0);
    return vec4(nil_rotate(away, m_sincos(-turn * h)) * horizontal, turn * 2.0 * h, 0.0) / length_out;
}

float geo_closeness(vec4 p, vec4 q) {
    return M_INFINITY;
}

float geo_area_density(Geodesic g, float t) {
    float h = 0.5 * g.velocity.z * t;
    float s = nil_sine_ratio(h);
    float way = dot(g.velocity.xy, g.velocity.xy) * t * t;
    return abs(t * t * s * (s * (1.0 + 0.25 * way * s * s) - way * nil_fall(2.0 * h) * m_sincos(h).y));
}

float geo_length(Geodesic g, float u) {
    return u;
}

float geo_parameter_at(Geodesic g, float t) {
    return t;
}

Geodesic geo_advance(Geodesic g, float u) {
    return geo_flow(g, u);
}

float geo_side(vec4 p, vec4 plane) {
    return dot(plane, p);
}

float nil_exit_upright(Geodesic g, vec4 plane) {
    float w = g.velocity.z;
    float size = dot(plane, g.point);
    float rate = dot(plane.xy, g.velocity.xy);
    float bend = w * size + 2.0 * (plane.y * g.velocity.x - plane.x * g.velocity.y);
    float discriminant = rate * rate - w * bend * size;
    if (discriminant < 0.0) return M_INFINITY;
    float root = sqrt(discriminant);
    if (rate > IO_ALONG_FACE) return max(2.0 * nil_arc_over_rate(-size / (rate + root), w), 0.0);
    if (size > IO_ON_FACE || (size > -IO_ON_FACE && rate > -IO_ALONG_FACE)) return M_INFINITY;
    float rise = root - rate;
    return rise > 0.0 && abs(w) > 1e-30 ? 2.0 * m_atan(rise, w < 0.0 ? -bend : bend) / abs(w) : M_INFINITY;
}

float nil_exit_slanted(Geodesic g, vec4 plane, float reach) {
    float w = max(abs(g.velocity.z), 1e-12);
    float square = dot(g.velocity.xy, g.velocity.xy);
    float c = sqrt(square);
    float centre = g.point.x - g.velocity.y / (g.velocity.z < 0.0 ? -w : w);
    float amplitude = c / w * length(vec2(plane.x, plane.y + plane.z * centre)) + 0.25 * abs(plane.z) * square / (w * w);
    bool recedes = plane.z * g.velocity.z <= 0.0;
    float t = 0.0;
    for (int i = 0; i < PASSAGE_STEPS && t <= min(reach, 1e6); i++) {
        Geodesic h = geo_flow(g, t);
        float value = dot(plane, h.point);
        if (recedes && value < -2.0 * amplitude) break;
        float slope = plane.y + plane.z * h.point.x;
        float rate = dot(vec3(plane.x, slope, plane.z), h.velocity.xyz);
        if (passage_arrives(value, rate)) return max(t - value / rate, 0.0);
        t += passage_step(value, rate, w * c * length(vec2(plane.x, slope)) + 2.5 * abs(plane.z) * square);
    }
    return M_INFINITY;
}

float geo_exit(Geodesic g, vec4 plane, float reach) {
    return plane.z == 0.0 ? nil_exit_upright(g, plane) : nil_exit_slanted(g, plane, reach);
}

float geo_arc(Geodesic g, float u_max, float tolerance) {
    // Bound of the third derivative over a step: see the twin.
    vec2 squares = g.velocity.xy * g.velocity.xy;
    float square = squares.x + squares.y;
    float w = abs(g.velocity.z);
    float turn = w * w * sqrt(square);
    float lean = w * abs(2.0 * squares.x - squares.y);
    float growth = 4.0 * w * w * square;
    float deviation = tolerance / (1.0 + 0.25 * tolerance);
#define NIL_THIRD(h) length(vec2(turn, lean + growth * (h)))
    M_RETURN_LONGEST_ARC(NIL_THIRD, deviation, u_max);
}

float geo_parameter(Geodesic g, vec3 c) {
    float t = 0.0;
    for (int i = 0; i < 8; i++) {
        Geodesic h = geo_flow(g, t);
        vec3 way = nil_displacement(h.point.xyz, c);
        float correction = dot(vec3(way.xy, way.z - 0.5 * way.x * way.y), h.velocity.xyz);
        t += correction;
        if (abs(correction) <= 1e-7 * (1.0 + abs(t))) break;
    }
    return t;
}

Geodesic geo_restore(Geodesic g) {
    return Geodesic(vec4(g.point.xyz, 1.0), vec4(normalize(g.velocity.xyz), 0.0));
}

vec3 geo_chart(vec4 p) {
    return p.xyz;
}

vec4 geo_unchart(vec3 c) {
    return vec4(c, 1.0);
}

vec4 geo_unchart_vector(vec4 p, vec3 dc) {
    return vec4(dc.xy, dc.z - p.x * dc.y, 0.0);
}

vec3 geo_chart_vector(vec4 p, vec4 v) {
    return vec3(v.xy, v.z + p.x * v.y);
}

vec3 geo_spray(vec3 c, vec3 v) {
    float w = v.z - c.x * v.y;
    return vec3(-w * v.y, w * v.x, v.x * v.y + c.x * w * v.x);
}

vec4 geo_raise(vec4 p, vec3 conormal) {
    return vec4(normalize(vec3(conormal.x, conormal.y + p.x * conormal.z, conormal.z)), 0.0);
}

vec3 geo_lower(vec4 p, vec4 v) {
    return vec3(v.x, v.y - p.x * v.z, v.z);
}

Geodesic geo_apply(Isometry m, Geodesic g) {
    // The matrix says all but the terms that turn the symmetric coordinate of the fibre back to z.
    vec2 a = m.linear[0].xy;
    vec2 b = m.linear[1].xy;
    vec2 p = g.point.xy;
    vec4 point = m.linear * g.point;
    point.z += 0.5 * (a.x * a.y * p.x * p.x + b.x * b.y * p.y * p.y) + a.y * b.x * p.x * p.y;
    return Geodesic(point, vec4(a * g.velocity.x + b * g.velocity.y, m.linear[2].z * g.velocity.z, 0.0));
}

Geodesic geo_cross(Isometry folded, vec4 plane, Geodesic g) {
    return geo_apply(folded, g);
}
