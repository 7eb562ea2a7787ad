// Products of a surface of curvature PRODUCT_CURVATURE = +-1, which the file that includes this one sets, with a
// line: the whole contract of shaders/geometry/e3.glsl. Twin, with the theory: src/geometry/product.rs.
//
// Points (x, y, z, w) with x^2 + y^2 + k w^2 = k, z the line. Flow p cos(ct) + h t sinc(ct) with c the speed in the
// surface; chart (x/w, y/w, z); curve parameter arc length.
#include "shared/passage.glsl"

vec4 product_slice(vec4 v) {
    return vec4(v.xy, 0.0, v.w);
}

float product_form(vec4 u, vec4 v) {
    return dot(u.xy, v.xy) + PRODUCT_CURVATURE * u.w * v.w;
}

// (sin, cos) or (sinh, cosh).
vec2 product_sincos(float x) {
    return PRODUCT_CURVATURE > 0.0 ? m_sincos(x) : m_sinhcosh(x);
}

// Length of the part of a tangent vector in the surface; in the hyperbolic plane by Lagrange's identity, as in
// h3.glsl.
float product_norm(vec4 p, vec4 v) {
    if (PRODUCT_CURVATURE > 0.0) return length(v.xyw);
    float moment = p.x * v.y - p.y * v.x;
    return sqrt(dot(v.xy, v.xy) + moment * moment) / p.w;
}

// The same of a unit velocity, from the part that says it best.
float product_speed(Geodesic g) {
    float b = g.velocity.z;
    return abs(b) < 0.7 ? sqrt((1.0 - b) * (1.0 + b)) : product_norm(g.point, g.velocity);
}

float product_sine_ratio(float x) {
    float y = PRODUCT_CURVATURE * x * x;
    return abs(x) < 1e-2 ? 1.0 - y * (1.0 / 6.0) : product_sincos(x).x / x;
}

// Inverse of the tangent of the curvature.
float product_arc_tangent(float x) {
    return PRODUCT_CURVATURE > 0.0 ? m_atan(x, 1.0) : m_atanh(x);
}

// arctan(c y) / c.
float product_arc_over_speed(float y, float c) {
    float x = c * y;
    float square = PRODUCT_CURVATURE * x * x;
    return abs(x) < 2e-2 ? y * (1.0 - square * (1.0 / 3.0)) : product_arc_tangent(x) / c;
}

bool product_vertical(vec4 plane) {
    return plane.z == 0.0;
}

bool product_horizontal(vec4 plane) {
    return plane.x == 0.0 && plane.y == 0.0;
}

vec4 geo_base() {
    return vec4(0.0, 0.0, 0.0, 1.0);
}

float geo_inner(vec4 p, vec4 u, vec4 v) {
    return product_form(u, v) + u.z * v.z;
}

Geodesic geo_flow(Geodesic g, float t) {
    float c = product_speed(g);
    vec2 sc = product_sincos(c * t);
    vec4 p = product_slice(g.point);
    vec4 h = product_slice(g.velocity);
    vec4 point = p * sc.y + h * (t * product_sine_ratio(c * t));
    vec4 velocity = h * sc.y - p * (PRODUCT_CURVATURE * c * sc.x);
    point.z = g.point.z + g.velocity.z * t;
    velocity.z = g.velocity.z;
    return Geodesic(point, velocity);
}

vec4 geo_log(vec4 p, vec4 q, out float length_out) {
    vec4 a = product_slice(p);
    vec4 difference = product_slice(q) - a;
    float half_chord = 0.5 * sqrt(max(product_form(difference, difference), 0.0));
    vec4 tangent = difference - a * (PRODUCT_CURVATURE * product_form(a, difference));
    float norm = product_norm(a, tangent);
    // Far away in the hyperbolic plane the chord is a small difference of large squares; the norm is sinh d.
    float along = PRODUCT_CURVATURE > 0.0
        ? 2.0 * m_atan(half_chord, 0.5 * length((p + q).xyw))
        : norm > 1.0 ? m_asinh(norm) : 2.0 * m_asinh(half_chord);
    // At the base of nothing, and at the antipode, any direction of the surface serves.
    vec4 turn = vec4(1.0, 0.0, 0.0, 0.0) - PRODUCT_CURVATURE * (geo_base() + a) * (a.x / max(1.0 + a.w, 1e-6));
    vec4 way = (norm > 0.0 ? tangent / norm : turn) * along;
    way.z = q.z - p.z;
    length_out = length(vec2(along, way.z));
    return length_out > 0.0 ? way / length_out : vec4(0.0, 0.0, 1.0, 0.0);
}

float geo_closeness(vec4 p, vec4 q) {
    return M_INFINITY;
}

float geo_area_density(Geodesic g, float t) {
    return abs(t * t * product_sine_ratio(product_speed(g) * t));
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

vec3 geo_chart(vec4 p) {
    return vec3(p.xy / p.w, p.z);
}

float geo_side(vec4 p, vec4 plane) {
    float upright = dot(plane.xy, p.xy);
    return product_vertical(plane) ? upright + plane.w * p.w : upright / p.w + plane.z * p.z + plane.w;
}

// Exit through a vertical plane: a cos(ct) + b t sinc(ct) = 0 from below.
float product_exit_vertical(Geodesic g, vec4 plane) {
    float a = dot(plane, g.point);
    float b = dot(plane, g.velocity);
    float c = product_speed(g);
    if (PRODUCT_CURVATURE > 0.0) {
        float radius = length(vec2(a * c, b));
        if (b > IO_ALONG_FACE) return max(2.0 * product_arc_over_speed(-a / (radius + b), c), 0.0);
        return a < -IO_ON_FACE && c > 1e-20 ? 2.0 * m_atan(radius - b, -a * c) / c : M_INFINITY;
    }
    if (b <= IO_ALONG_FACE) return M_INFINITY;
    return -a * c < b ? max(product_arc_over_speed(-a / b, c), 0.0) : M_INFINITY;
}

// Exit through a plane that is neither vertical nor horizontal; bounds as in chart_motion of the twin.
float product_exit_slanted(Geodesic g, vec4 plane, float reach) {
    float c = product_speed(g);
    float t = 0.0;
    for (int i = 0; i < PASSAGE_STEPS && t <= min(reach, 1e6); i++) {
        Geodesic h = geo_flow(g, t);
        vec4 p = h.point;
        vec4 v = h.velocity;
        if (p.w <= IO_ON_FACE || isinf(p.w)) break;
        float value = geo_side(p, plane);
        float upright = dot(plane.xy, v.xy - p.xy / p.w * v.w) / p.w;
        float rate = upright + plane.z * v.z;
        if (passage_arrives(value, rate)) return max(t - value / rate, 0.0);
        float room = PRODUCT_CURVATURE > 0.0 ? p.w : 1.0;
        t += min(passage_step(value, rate, 16.0 * c * abs(upright) / room), 0.5 * room / max(c, 1e-20));
    }
    return M_INFINITY;
}

float geo_exit(Geodesic g, vec4 plane, float reach) {
    if (product_vertical(plane)) return product_exit_vertical(g, plane);
    if (!product_horizontal(plane)) return product_exit_slanted(g, plane, reach);
    float rate = plane.z * g.velocity.z;
    return rate > IO_ALONG_FACE ? max(-geo_side(g.point, plane) / rate, 0.0) : M_INFINITY;
}

// Bound of the third derivative over a step of length t: see the twin.
float product_third(float t, float lean, float start, float c) {
    float growth = (start + 1.1 * c * c * t) / (1.0 - max(PRODUCT_CURVATURE, 0.0) * 1.1 * start * t);
    if (PRODUCT_CURVATURE < 0.0) growth = min(growth, c);
    float third = max(6.0 * growth * growth + 2.0 * PRODUCT_CURVATURE * c * c, 2.0 * c * c);
    return lean * third * exp(2.0 * growth * t);
}

float geo_arc(Geodesic g, float u_max, float tolerance) {
    float c = product_speed(g);
    float lean = c * abs(g.velocity.z);
    float start = abs(g.velocity.w / g.point.w);
    float limit = min(0.45 / max(c + 1.1 * start, 1e-30), u_max);
    // The bound rises by a factor of 15 at most up to the limit, so that its bounds of the arc are never far apart.
    float most = m_arc(product_third(0.0, lean, start, c), tolerance, limit);
    float least = m_arc(product_third(most, lean, start, c), tolerance, limit);
    return PRODUCT_CURVATURE < 0.0 ? least : m_arc_between(most, least);
}

float geo_parameter(Geodesic g, vec3 c) {
    vec4 x = vec4(c.xy, 0.0, 1.0);
    float rise = g.velocity.z * (c.z - g.point.z);
    float speed = product_speed(g);
    if (speed < 1e-9) return rise;
    float tangent = PRODUCT_CURVATURE * product_form(x, g.velocity) / product_form(x, g.point);
    return speed * product_arc_tangent(tangent / speed) + rise;
}

Geodesic geo_restore(Geodesic g) {
    vec4 p = product_slice(g.point);
    p = PRODUCT_CURVATURE > 0.0 ? p / length(p) : vec4(p.xyz, sqrt(1.0 + dot(p.xy, p.xy)));
    vec4 v = product_slice(g.velocity);
    v -= p * (PRODUCT_CURVATURE * product_form(p, v));
    // Tangent to the last digit, where w is large.
    if (PRODUCT_CURVATURE < 0.0) v.w = dot(v.xy, p.xy) / p.w;
    float norm = length(vec2(product_norm(p, v), g.velocity.z));
    p.z = g.point.z;
    v.z = g.velocity.z;
    return Geodesic(p, v / norm);
}

vec4 geo_unchart(vec3 c) {
    vec4 p = vec4(c.xy, 0.0, 1.0) * inversesqrt(1.0 + PRODUCT_CURVATURE * dot(c.xy, c.xy));
    p.z = c.z;
    return p;
}

vec4 geo_unchart_vector(vec4 p, vec3 dc) {
    // Normal part of the lifted vector, taken off.
    float normal = dot(p.xy, dc.xy);
    return vec4((dc.xy - PRODUCT_CURVATURE * normal * p.xy) * p.w, dc.z, -PRODUCT_CURVATURE * normal * p.w * p.w);
}

vec3 geo_chart_vector(vec4 p, vec4 v) {
    return vec3((v.xy - p.xy / p.w * v.w) / p.w, v.z);
}

vec3 geo_spray(vec3 c, vec3 v) {
    float rate = 2.0 * PRODUCT_CURVATURE * dot(c.xy, v.xy) / (1.0 + PRODUCT_CURVATURE * dot(c.xy, c.xy));
    return vec3(v.xy * rate, 0.0);
}

vec4 geo_raise(vec4 p, vec3 conormal) {
    vec2 n = conormal.xy / p.w;
    vec4 raised = vec4(n, conormal.z, -PRODUCT_CURVATURE * dot(n, p.xy) / p.w);
    return raised / length(vec2(product_norm(p, raised), raised.z));
}

vec3 geo_lower(vec4 p, vec4 v) {
    return vec3(v.xy * p.w, v.z);
}

Geodesic geo_apply(Isometry m, Geodesic g) {
    return Geodesic(m.linear * g.point + m.shift, m.linear * g.velocity);
}

// The state reflected in a vertical or horizontal plane, and then the folded pairing.
Geodesic geo_cross(Isometry folded, vec4 plane, Geodesic g) {
    if (product_vertical(plane)) {
        vec4 normal = vec4(plane.xy, 0.0, PRODUCT_CURVATURE * plane.w);
        g.point -= normal * (2.0 * dot(plane, g.point));
        g.velocity -= normal * (2.0 * dot(plane, g.velocity));
    } else if (product_horizontal(plane)) {
        g.point.z -= 2.0 * plane.z * (plane.z * g.point.z + plane.w);
        g.velocity.z -= 2.0 * plane.z * plane.z * g.velocity.z;
    }
    return geo_apply(folded, g);
}
