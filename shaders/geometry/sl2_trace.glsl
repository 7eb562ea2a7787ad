// SL(2, R) with the Lorentzian trace form. Twin: src/geometry/sl2_trace.rs. Contract: e3.glsl.
//
// Points (x, y, z, w): the matrix [[1+x, y], [z, 1+w]] of determinant 1; vectors (u, v, w): the matrix
// [[u, v], [w, -u]]; chart (x, y, z), x != -1; lengths are affine parameters. Flow p exp(tA) = p(C + S A).

const bool GEO_STRAIGHT = false;

const float SL2_TRACE_ROOT = 1.41421356;

mat2 sl2_trace_matrix(vec4 p) {
    return mat2(1.0 + p.x, p.z, p.y, 1.0 + p.w);
}

mat2 sl2_trace_algebra(vec4 v) {
    return mat2(v.x, v.z, v.y, -v.x);
}

vec4 sl2_trace_traceless(mat2 m) {
    return vec4(0.5 * (m[0][0] - m[1][1]), m[1][0], m[0][1], 0.0);
}

vec4 sl2_trace_entries(mat2 m) {
    return vec4(m[0][0], m[1][0], m[0][1], m[1][1]);
}

mat2 sl2_trace_adjugate(mat2 m) {
    return mat2(m[1][1], -m[0][1], -m[1][0], m[0][0]);
}

float sl2_trace_square(vec4 v) {
    return v.x * v.x + v.y * v.z;
}

// Components in the frame, whose Euclidean length is the norm; and back.
vec3 sl2_trace_framed(vec4 v) {
    return vec3(2.0 * v.x, v.y + v.z, v.z - v.y) / SL2_TRACE_ROOT;
}

vec4 sl2_trace_unframed(vec3 c) {
    return vec4(c.x, c.y - c.z, c.y + c.z, 0.0) / SL2_TRACE_ROOT;
}

// The largest component of a velocity, to divide by: its squares may leave the numbers.
float sl2_trace_scale(vec4 v) {
    return max(max(abs(v.x), abs(v.y)), max(abs(v.z), 1e-37));
}

// exp(tA) less the identity. Far out C + S A = e^(-sqrt(q) t) + S(sqrt(q) + A), with the difference of sqrt(q) and |u|
// as vw / (sqrt(q) + |u|), cancels nothing.
mat2 sl2_trace_exp(vec4 v, float t) {
    float q = sl2_trace_square(v);
    float root = sqrt(max(q, 0.0));
    vec4 forth = t < 0.0 ? -v : v;
    t = abs(t);
    float sinh_t = t * m_cosh_sinhc(q * t * t).y;
    if (root * t < 1.0) {
        float half_sinh = t * m_cosh_sinhc(0.25 * q * t * t).y;
        return mat2(0.5 * q * half_sinh * half_sinh) + sl2_trace_algebra(forth) * sinh_t;
    }
    float sum = root + abs(v.x);
    float difference = v.y * v.z / sum;
    vec2 diagonal = forth.x > 0.0 ? vec2(sum, difference) : vec2(difference, sum);
    return mat2(2.0 * m_half_exp(-root * t) - 1.0) + mat2(diagonal.x, forth.z, forth.y, diagonal.y) * sinh_t;
}

// Length at which the geodesic reaches x = -1, forwards.
float sl2_trace_edge(Geodesic g) {
    float first = 1.0 + g.point.x;
    float scale = sl2_trace_scale(g.velocity);
    vec4 v = g.velocity / scale;
    float rate = first * v.x + g.point.y * v.z;
    return m_artanh_over(sl2_trace_square(v), abs(first), -rate * sign(first)) / scale;
}

vec4 sl2_trace_point(vec3 c) {
    return vec4(c, (c.y * c.z - c.x) / (1.0 + c.x));
}

// The tangent vector at p with chart components dc.
vec4 geo_unchart_vector(vec4 p, vec3 dc) {
    float fourth = (dc.y * p.z + p.y * dc.z - (1.0 + p.w) * dc.x) / (1.0 + p.x);
    return sl2_trace_traceless(sl2_trace_adjugate(sl2_trace_matrix(p)) * mat2(dc.x, dc.z, dc.y, fourth));
}

vec4 geo_base() {
    return vec4(0.0);
}

float geo_inner(vec4 p, vec4 u, vec4 v) {
    return 2.0 * u.x * v.x + u.y * v.z + u.z * v.y;
}

Geodesic geo_flow(Geodesic g, float t) {
    Geodesic ahead = Geodesic(g.point, t < 0.0 ? -g.velocity : g.velocity);
    if (sl2_trace_edge(ahead) <= abs(t)) return Geodesic(vec4(M_INFINITY), g.velocity);
    float scale = sl2_trace_scale(g.velocity);
    vec4 v = g.velocity / scale;
    t *= scale;
    return Geodesic(g.point + sl2_trace_entries(sl2_trace_matrix(g.point) * sl2_trace_exp(v, t)), g.velocity);
}

vec4 geo_log(vec4 p, vec4 q, out float length_out) {
    vec4 d = q - p;
    mat2 step = sl2_trace_adjugate(sl2_trace_matrix(p)) * mat2(d.x, d.z, d.y, d.w);
    vec4 sine = sl2_trace_traceless(step);
    float cosine = 1.0 + 0.5 * (step[0][0] + step[1][1]);
    float norm = length(sl2_trace_framed(sine));
    length_out = norm > 0.0 ? m_artanh_over(sl2_trace_square(sine), 1.0, cosine) * norm : 0.0;
    return norm > 0.0 ? sine / norm : sl2_trace_unframed(vec3(1.0, 0.0, 0.0));
}

float geo_closeness(vec4 p, vec4 q) {
    return M_INFINITY;
}

float geo_area_density(Geodesic g, float t) {
    const vec3 structure = SL2_TRACE_ROOT * vec3(1.0, 1.0, -1.0);
    vec3 v = sl2_trace_framed(g.velocity);
    vec2 c = m_integrals(4.0 * sl2_trace_square(g.velocity) * t * t);
    mat3 m;
    for (int i = 0; i < 3; i++) {
        vec3 axis = vec3(i == 0, i == 1, i == 2);
        vec3 once = cross(v, axis) * structure * t;
        m[i] = axis - once * c.x + cross(v, once) * structure * (t * c.y);
    }
    return length(cross(m[1], m[2]) * v.x + cross(m[2], m[0]) * v.y + cross(m[0], m[1]) * v.z) * t * t;
}

float geo_length(Geodesic g, float u) {
    return u;
}

float geo_parameter_at(Geodesic g, float t) {
    t = min(t, 3e38);
    return t < sl2_trace_edge(g) ? t : M_INFINITY;
}

Geodesic geo_advance(Geodesic g, float u) {
    return geo_flow(g, u);
}

float geo_side(vec4 p, vec4 plane) {
    return dot(plane.xyz, p.xyz) + plane.w;
}

float geo_exit(Geodesic g, vec4 plane, float reach) {
    float q = sl2_trace_square(g.velocity);
    float even = dot(plane.xyz, g.point.xyz) + plane.x;
    float rate = dot(plane.xyz, sl2_trace_entries(sl2_trace_matrix(g.point) * sl2_trace_algebra(g.velocity)).xyz);
    float start = geo_side(g.point, plane);
    if (abs(start) <= IO_ON_FACE) start = 0.0;
    float u = m_first_passage(q, start, rate, q * (even - plane.w + plane.x), IO_ALONG_FACE);
    return u < sl2_trace_edge(g) ? u : M_INFINITY;
}

// Bound of the third derivative over a step h: see the twin.
float sl2_trace_third(float q, float slope, float norm, float h) {
    vec2 sc = m_sincos(slope + norm * h);
    float beta = sc.x / sc.y;
    return q * norm * 2.0 * m_half_exp(norm * h * (1.0 + sqrt(1.0 + beta * beta)));
}

float geo_arc(Geodesic g, float u_max, float tolerance) {
    float norm = length(sl2_trace_framed(g.velocity));
    float q = abs(sl2_trace_square(g.velocity));
    float slope = m_atan(abs(g.point.y), abs(1.0 + g.point.x));
    float limit = min(u_max, 0.5 * (M_HALF_PI - slope) / norm);
    // The bound rises by a factor of e^1.9 at most up to the limit, so that its bounds of the arc are never far apart.
    float most = m_arc(sl2_trace_third(q, slope, norm, 0.0), tolerance, limit);
    float near = m_arc_between(most, m_arc(sl2_trace_third(q, slope, norm, most), tolerance, limit));
    most = m_arc(sl2_trace_third(q, slope, norm, near), tolerance, limit);
    return m_arc(sl2_trace_third(q, slope, norm, most), tolerance, limit);
}

float geo_parameter(Geodesic g, vec3 c) {
    vec3 v = sl2_trace_framed(g.velocity);
    float s = 0.0;
    for (int i = 0; i < 12; i++) {
        Geodesic at = geo_flow(g, s);
        vec3 off = sl2_trace_framed(geo_unchart_vector(at.point, c - at.point.xyz));
        float step = dot(off, v) / max(dot(v, v), 1e-37);
        if (isinf(step) || isnan(step)) break;
        s += step;
        if (abs(step) <= 1e-7 * (0.1 + abs(s))) break;
    }
    return s;
}

Geodesic geo_restore(Geodesic g) {
    return Geodesic(sl2_trace_point(g.point.xyz), vec4(g.velocity.xyz, 0.0));
}

vec3 geo_chart(vec4 p) {
    return p.xyz;
}

vec4 geo_unchart(vec3 c) {
    return sl2_trace_point(c);
}

vec3 geo_chart_vector(vec4 p, vec4 v) {
    return sl2_trace_entries(sl2_trace_matrix(p) * sl2_trace_algebra(v)).xyz;
}

vec3 geo_spray(vec3 c, vec3 v) {
    float first = 1.0 + c.x;
    float fourth = (v.y * c.z + c.y * v.z - v.x * (1.0 + c.y * c.z) / first) / first;
    float q = v.y * v.z - v.x * fourth;
    return vec3(first, c.yz) * q;
}

vec4 geo_raise(vec4 p, vec3 conormal) {
    vec3 along;
    for (int i = 0; i < 3; i++) {
        vec4 e = sl2_trace_unframed(vec3(i == 0, i == 1, i == 2));
        along[i] = dot(conormal, sl2_trace_entries(sl2_trace_matrix(p) * sl2_trace_algebra(e)).xyz);
    }
    return sl2_trace_unframed(normalize(along * vec3(1.0, 1.0, -1.0)));
}

vec3 geo_lower(vec4 p, vec4 v) {
    vec3 lowered;
    for (int i = 0; i < 3; i++) {
        lowered[i] = geo_inner(p, v, geo_unchart_vector(p, vec3(i == 0, i == 1, i == 2)));
    }
    return lowered;
}

Geodesic geo_apply(Isometry m, Geodesic g) {
    return Geodesic(m.linear * g.point + m.shift, g.velocity);
}

Geodesic geo_cross(Isometry m, vec4 plane, Geodesic g) {
    return geo_apply(m, g);
}
