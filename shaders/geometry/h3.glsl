// Hyperbolic space, upper sheet of the hyperboloid in R^{3,1}. Twin: src/geometry/h3.rs. Contract: e3.glsl.
//
// Flow p cosh t + v sinh t; Klein chart xyz/w; curve parameter tanh t.

const bool GEO_STRAIGHT = true;

float h3_form(vec4 u, vec4 v) {
    return dot(u.xyz, v.xyz) - u.w * v.w;
}

// Length of a tangent vector, times p.w: <v, v> = v^2 - (p.v)^2 / p.w^2 by Lagrange's identity, without what cancels far
// from the base point.
float h3_norm_w(vec3 p, vec3 v) {
    vec3 moment = cross(p, v);
    return sqrt(dot(v, v) + dot(moment, moment));
}

float h3_norm(vec4 p, vec4 v) {
    return h3_norm_w(p.xyz, v.xyz) / p.w;
}

vec4 geo_base() {
    return vec4(0.0, 0.0, 0.0, 1.0);
}

float geo_inner(vec4 p, vec4 u, vec4 v) {
    return h3_form(u, v);
}

Geodesic geo_flow(Geodesic g, float t) {
    vec2 sc = m_sinhcosh(t);
    return Geodesic(g.point * sc.y + g.velocity * sc.x, g.velocity * sc.y + g.point * sc.x);
}

vec4 geo_log(vec4 p, vec4 q, out float length_out) {
    vec4 difference = q - p;
    vec4 tangent = difference + p * h3_form(p, difference);
    // sinh d. The chord is exact for near points, and far away a small difference of large squares.
    float norm = h3_norm(p, tangent);
    length_out = norm > 1.0 ? m_asinh(norm) : 2.0 * m_asinh(0.5 * sqrt(max(h3_form(difference, difference), 0.0)));
    // At the base of nothing any direction serves: the coordinate direction that is parallel from the base point.
    return norm > 0.0 ? tangent / norm : vec4(1.0, 0.0, 0.0, 0.0) + (geo_base() + p) * (p.x / (1.0 + p.w));
}

float geo_closeness(vec4 p, vec4 q) {
    return h3_form(p, q);
}

float geo_area_density(Geodesic g, float t) {
    float s = m_sinhcosh(t).x;
    return s * s;
}

float geo_length(Geodesic g, float u) {
    return m_atanh(u);
}

float geo_parameter_at(Geodesic g, float t) {
    // From here on tanh t rounds to 1, where the geodesic's end lies.
    return t < 8.5 ? m_tanh(t) : M_INFINITY;
}

Geodesic geo_advance(Geodesic g, float u) {
    float scale = inversesqrt((1.0 - u) * (1.0 + u));
    return Geodesic((g.point + g.velocity * u) * scale, (g.velocity + g.point * u) * scale);
}

float geo_side(vec4 p, vec4 plane) {
    return dot(plane, p);
}

float geo_exit(Geodesic g, vec4 plane, float reach) {
    float rate = dot(plane, g.velocity);
    if (rate <= IO_ALONG_FACE) return M_INFINITY;
    float u = max(-dot(plane, g.point) / rate, 0.0);
    return u < 1.0 ? u : M_INFINITY;
}

float geo_arc(Geodesic g, float u_max, float tolerance) {
    return u_max;
}

float geo_parameter(Geodesic g, vec3 c) {
    vec4 x = vec4(c, 1.0);
    return h3_form(x, g.velocity) / -h3_form(x, g.point);
}

Geodesic geo_restore(Geodesic g) {
    vec3 x = g.point.xyz;
    vec4 point = vec4(x, sqrt(1.0 + dot(x, x)));
    vec3 tangent = g.velocity.xyz + x * h3_form(point, g.velocity);
    return Geodesic(point, vec4(tangent * point.w, dot(tangent, x)) * (1.0 / h3_norm_w(x, tangent)));
}

vec3 geo_chart(vec4 p) {
    return p.xyz / p.w;
}

vec4 geo_unchart(vec3 c) {
    float r = length(c);
    return vec4(c, 1.0) * inversesqrt((1.0 - r) * (1.0 + r));
}

vec4 geo_unchart_vector(vec4 p, vec3 dc) {
    vec4 lifted = vec4(dc, 0.0);
    return (lifted + p * h3_form(p, lifted)) * p.w;
}

vec3 geo_chart_vector(vec4 p, vec4 v) {
    return (v.xyz - geo_chart(p) * v.w) / p.w;
}

vec3 geo_spray(vec3 c, vec3 v) {
    return v * (-2.0 * dot(c, v) / (1.0 - dot(c, c)));
}

vec4 geo_raise(vec4 p, vec3 conormal) {
    vec4 n = vec4(conormal, dot(conormal, geo_chart(p)));
    return n / h3_norm(p, n);
}

vec3 geo_lower(vec4 p, vec4 v) {
    return v.xyz * p.w;
}

Geodesic geo_apply(Isometry m, Geodesic g) {
    return Geodesic(m.linear * g.point, m.linear * g.velocity);
}

Geodesic geo_cross(Isometry folded, vec4 plane, Geodesic g) {
    vec4 normal = vec4(plane.xyz, -plane.w);
    vec4 point = g.point - normal * (2.0 * dot(plane, g.point));
    vec4 velocity = g.velocity - normal * (2.0 * dot(plane, g.velocity));
    return geo_apply(folded, Geodesic(point, velocity));
}
