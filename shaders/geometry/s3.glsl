// The unit three-sphere in R^4. Twin: src/geometry/s3.rs. Contract: e3.glsl.
//
// Flow p cos t + v sin t; gnomonic chart xyz/w (w > 0); curve parameter tan(t/2).

const bool GEO_STRAIGHT = true;

vec4 geo_base() {
    return vec4(0.0, 0.0, 0.0, 1.0);
}

float geo_inner(vec4 p, vec4 u, vec4 v) {
    return dot(u, v);
}

Geodesic geo_flow(Geodesic g, float t) {
    vec2 sc = m_sincos(t);
    return Geodesic(g.point * sc.y + g.velocity * sc.x, g.velocity * sc.y - g.point * sc.x);
}

vec4 geo_log(vec4 p, vec4 q, out float length_out) {
    vec4 difference = q - p;
    length_out = 2.0 * m_atan(length(difference), length(q + p));
    vec4 tangent = difference - p * dot(p, difference);
    float norm = length(tangent);
    // At the base of nothing any direction serves: the coordinate direction that is parallel from the base point.
    return norm > 0.0 ? tangent / norm : vec4(1.0, 0.0, 0.0, 0.0) - (geo_base() + p) * (p.x / (1.0 + p.w));
}

float geo_closeness(vec4 p, vec4 q) {
    return dot(p, q);
}

float geo_area_density(Geodesic g, float t) {
    float s = m_sincos(t).x;
    return s * s;
}

float geo_length(Geodesic g, float u) {
    return 2.0 * m_atan(u, 1.0);
}

float geo_parameter_at(Geodesic g, float t) {
    if (t >= M_PI) return M_INFINITY;
    vec2 sc = m_sincos(0.5 * t);
    return sc.x / sc.y;
}

Geodesic geo_advance(Geodesic g, float u) {
    float scale = 1.0 / (1.0 + u * u);
    float c = (1.0 - u * u) * scale;
    float s = 2.0 * u * scale;
    return Geodesic(g.point * c + g.velocity * s, g.velocity * c - g.point * s);
}

float geo_side(vec4 p, vec4 plane) {
    return dot(plane, p);
}

float geo_exit(Geodesic g, vec4 plane, float reach) {
    // a cos t + b sin t = 0 from below: tan(t/2) = -a / (sqrt(a^2 + b^2) + b).
    float a = dot(plane, g.point);
    float b = dot(plane, g.velocity);
    float radius = sqrt(a * a + b * b);
    if (b > IO_ALONG_FACE) return max(-a / (radius + b), 0.0);
    return a < -IO_ON_FACE ? (radius - b) / -a : M_INFINITY;
}

float geo_arc(Geodesic g, float u_max, float tolerance) {
    return u_max;
}

float geo_parameter(Geodesic g, vec3 c) {
    vec4 x = vec4(c, 1.0);
    float cosine = dot(x, g.point);
    float sine = dot(x, g.velocity);
    return sine / (cosine + sqrt(cosine * cosine + sine * sine));
}

Geodesic geo_restore(Geodesic g) {
    vec4 point = normalize(g.point);
    return Geodesic(point, normalize(g.velocity - point * dot(point, g.velocity)));
}

vec3 geo_chart(vec4 p) {
    return p.xyz / p.w;
}

vec4 geo_unchart(vec3 c) {
    return normalize(vec4(c, 1.0));
}

vec4 geo_unchart_vector(vec4 p, vec3 dc) {
    vec4 lifted = vec4(dc, 0.0);
    return (lifted - p * dot(p, lifted)) * p.w;
}

vec3 geo_chart_vector(vec4 p, vec4 v) {
    return (v.xyz - geo_chart(p) * v.w) / p.w;
}

vec3 geo_spray(vec3 c, vec3 v) {
    return v * (2.0 * dot(c, v) / (1.0 + dot(c, c)));
}

vec4 geo_raise(vec4 p, vec3 conormal) {
    return normalize(vec4(conormal, -dot(conormal, geo_chart(p))));
}

vec3 geo_lower(vec4 p, vec4 v) {
    return v.xyz * p.w;
}

Geodesic geo_apply(Isometry m, Geodesic g) {
    return Geodesic(m.linear * g.point, m.linear * g.velocity);
}

Geodesic geo_cross(Isometry folded, vec4 plane, Geodesic g) {
    vec4 normal = plane;
    vec4 point = g.point - normal * (2.0 * dot(plane, g.point));
    vec4 velocity = g.velocity - normal * (2.0 * dot(plane, g.velocity));
    return geo_apply(folded, Geodesic(point, velocity));
}
