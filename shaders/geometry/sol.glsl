// Sol. Twin: src/geometry/sol.rs. Contract: e3.glsl.
//
// Points (x, y, z, 1) of the group, vectors in the left-invariant frame, arc length as parameter. Taylor series of
// z'' = B^2 e^-2z - A^2 e^2z with constant momenta, of order 9 in steps of 1/4: the rest is below the rounding of f32, as each
// order gains a factor of 2 pi. Short series are written out in full, by macros, so that their terms are registers and not
// memory: loops with loops inside whose ends depend on them are not unrolled, whatever they ask for (10 KB of memory for each
// ray on an NVIDIA H100, driver 580).

const bool GEO_STRAIGHT = false;

const int SOL_TERMS = 10;
const float SOL_STEP = 0.25;
const float SOL_RISE = 1.2840254; // e^SOL_STEP
const float SOL_HORIZON = 1.0; // longest arc; exits are looked for so far ahead at most
const float SOL_LONG = 64.0;   // from here on whole periods are counted
const float SOL_REACH = 85.0;  // beyond it e^z leaves f32

// What is done for each order of a series, upwards with the coefficient that a product of two series has there.
#define SOL_UPWARDS(DO)                                                                                                  \
    DO(0, SOL_PRODUCT_0) DO(1, SOL_PRODUCT_1) DO(2, SOL_PRODUCT_2) DO(3, SOL_PRODUCT_3) DO(4, SOL_PRODUCT_4)             \
    DO(5, SOL_PRODUCT_5) DO(6, SOL_PRODUCT_6) DO(7, SOL_PRODUCT_7) DO(8, SOL_PRODUCT_8) DO(9, SOL_PRODUCT_9)
#define SOL_DOWNWARDS(DO) DO(9) DO(8) DO(7) DO(6) DO(5) DO(4) DO(3) DO(2) DO(1) DO(0)
#define SOL_PRODUCT_0(a, b) (a[0] * b[0])
#define SOL_PRODUCT_1(a, b) (a[0] * b[1] + a[1] * b[0])
#define SOL_PRODUCT_2(a, b) (a[0] * b[2] + a[1] * b[1] + a[2] * b[0])
#define SOL_PRODUCT_3(a, b) (a[0] * b[3] + a[1] * b[2] + a[2] * b[1] + a[3] * b[0])
#define SOL_PRODUCT_4(a, b) (a[0] * b[4] + a[1] * b[3] + a[2] * b[2] + a[3] * b[1] + a[4] * b[0])
#define SOL_PRODUCT_5(a, b) (a[0] * b[5] + a[1] * b[4] + a[2] * b[3] + a[3] * b[2] + a[4] * b[1] + a[5] * b[0])
#define SOL_PRODUCT_6(a, b) (a[0] * b[6] + a[1] * b[5] + a[2] * b[4] + a[3] * b[3] + a[4] * b[2]                         \
    + a[5] * b[1] + a[6] * b[0])
#define SOL_PRODUCT_7(a, b) (a[0] * b[7] + a[1] * b[6] + a[2] * b[5] + a[3] * b[4] + a[4] * b[3]                         \
    + a[5] * b[2] + a[6] * b[1] + a[7] * b[0])
#define SOL_PRODUCT_8(a, b) (a[0] * b[8] + a[1] * b[7] + a[2] * b[6] + a[3] * b[5] + a[4] * b[4]                         \
    + a[5] * b[3] + a[6] * b[2] + a[7] * b[1] + a[8] * b[0])
#define SOL_PRODUCT_9(a, b) (a[0] * b[9] + a[1] * b[8] + a[2] * b[7] + a[3] * b[6] + a[4] * b[5]                         \
    + a[5] * b[4] + a[6] * b[3] + a[7] * b[2] + a[8] * b[1] + a[9] * b[0])

// The series of e^2z, e^-2z and w from the identity.
struct SolSeries {
    float p[SOL_TERMS];
    float q[SOL_TERMS];
    float w[SOL_TERMS];
};

float sol_exp(float x) {
    return 2.0 * m_half_exp(x);
}

// (e^z x, e^-z y) for a possibly infinite exponential: nothing stays nothing.
vec2 sol_stretch(float z, vec2 v) {
    float rise = sol_exp(z);
    return vec2(v.x == 0.0 ? 0.0 : rise * v.x, v.y == 0.0 ? 0.0 : v.y / rise);
}

vec3 sol_product(vec3 a, vec3 b) {
    return vec3(a.xy + sol_stretch(a.z, b.xy), a.z + b.z);
}

vec3 sol_relative(vec3 p, vec3 q) {
    return vec3(sol_stretch(-p.z, q.xy - p.xy), q.z - p.z);
}

SolSeries sol_series(vec3 v) {
    SolSeries s;
    s.p[0] = 1.0;
    s.q[0] = 1.0;
    s.w[0] = v.z;
    vec2 square = v.xy * v.xy;
#define SOL_NEXT(k, PRODUCT)                                                        \
    if (k + 1 < SOL_TERMS) {                                                        \
        const float share = 1.0 / float(k + 1);                                     \
        s.w[(k + 1) % SOL_TERMS] = (square.y * s.q[k] - square.x * s.p[k]) * share; \
        s.p[(k + 1) % SOL_TERMS] = PRODUCT(s.p, s.w) * (2.0 * share);               \
        s.q[(k + 1) % SOL_TERMS] = PRODUCT(s.q, s.w) * (-2.0 * share);              \
    }
    SOL_UPWARDS(SOL_NEXT)
    return s;
}

// Point after `t` about the start of a step with frame velocity `v`, and the change of w.
vec4 sol_chart(SolSeries s, vec3 v, float t) {
    vec3 end = vec3(0.0);
    float bend = 0.0;
#define SOL_SUM(k)                                                                          \
    end = end * t + vec3(v.x * s.p[k], v.y * s.q[k], s.w[k]) * (1.0 / float(k + 1));        \
    if (k > 0) bend = bend * t + s.w[k];
    SOL_DOWNWARDS(SOL_SUM)
    return vec4(end * t, bend * t);
}

// What the variation (e^z dA, e^-z dB, dz, dw) of a step's start makes of x, y about the start, z and w.
vec4 sol_vary(SolSeries s, vec3 v, vec4 start, float t) {
    float dz[SOL_TERMS];
    float dw[SOL_TERMS];
    dz[0] = start.z;
    dw[0] = start.w;
    vec4 sum = vec4(0.0, 0.0, start.zw);
    float power = t;
    vec4 weights = vec4(start.xy, 2.0 * v.x, -2.0 * v.y);
    vec4 bends = vec4(-2.0 * v.x * start.x, 2.0 * v.y * start.y, -2.0 * v.x * v.x, -2.0 * v.y * v.y);
#define SOL_VARY(k, PRODUCT)                                                                              \
    {                                                                                                     \
        const float share = 1.0 / float(k + 1);                                                           \
        float pz = PRODUCT(s.p, dz);                                                                      \
        float qz = PRODUCT(s.q, dz);                                                                      \
        float bend = bends.x * s.p[k] + bends.y * s.q[k] + bends.z * pz + bends.w * qz;                   \
        vec2 side = weights.xy * vec2(s.p[k], s.q[k]) + weights.zw * vec2(pz, qz);                        \
        sum += vec4(side, dw[k], bend) * (power * share);                                                 \
        power *= t;                                                                                       \
        dz[(k + 1) % SOL_TERMS] = dw[k] * share;                                                          \
        dw[(k + 1) % SOL_TERMS] = bend * share;                                                           \
    }
    SOL_UPWARDS(SOL_VARY)
    return sum;
}

// A geodesic from the identity; the momenta stay those of the start.
struct SolTrack {
    vec3 start;
    vec3 point;
    float w;
};

vec3 sol_velocity(SolTrack track) {
    return vec3(sol_stretch(track.point.z, track.start.xy), track.w);
}

// Takes a step to `end`, in coordinates about its start, with the change of w.
void sol_take(inout SolTrack track, vec4 end) {
    track.point = sol_product(track.point, end.xyz);
    track.w += end.w;
}

void sol_step(inout SolTrack track, float t) {
    vec3 v = sol_velocity(track);
    sol_take(track, sol_chart(sol_series(v), v, t));
}

float sol_count(float t) {
    return max(ceil(abs(t) / SOL_STEP), 1.0);
}

SolTrack sol_walk(vec3 v, float t) {
    float count = sol_count(t);
    // Most ways are so short that the first step, from the identity, is the only one.
    vec4 end = sol_chart(sol_series(v), v, t / count);
    SolTrack track = SolTrack(v, end.xyz, v.z + end.w);
    for (float k = 1.0; k < count; k++) sol_step(track, t / count);
    return track;
}

// Length after which z and the velocity return: 2 pi / agm(sqrt(1 + 2k), 2 sqrt k), k = |uv|.
float sol_period(vec3 v) {
    float k = abs(v.x * v.y);
    vec2 means = vec2(sqrt(dot(v, v) + 2.0 * k), 2.0 * sqrt(k));
    for (int i = 0; i < 12; i++) means = vec2(0.5 * (means.x + means.y), sqrt(means.x * means.y));
    return means.y > 0.0 ? 2.0 * M_PI / means.y : M_INFINITY;
}

// The change of a track's end by a variation, in the frame there.
vec3 sol_varied(SolTrack track, vec4 varied) {
    return vec3(sol_stretch(-track.point.z, varied.xy), varied.z);
}

// A step of a variation of a track: (x, y, z, w) for a change of its start that changes the momenta by (dA, dB). `rise` is
// e^z where the step starts, `here` the velocity there.
void sol_vary_step(SolSeries series, vec3 here, float rise, vec2 momenta, float h, inout vec4 varied) {
    vec4 next = sol_vary(series, here, vec4(momenta.x * rise, momenta.y / rise, varied.zw), h);
    varied = vec4(varied.x + rise * next.x, varied.y + next.y / rise, next.zw);
}

// End of exp(t v), and the differential of the exponential map at t v in the frames of both ends. It takes v to the velocity
// at the end, so two more of its images say all: those of the axes that lie farthest from v.
vec3 sol_differential(vec3 v, float t, out mat3 differential) {
    differential = mat3(1.0);
    SolTrack track = SolTrack(v, vec3(0.0), v.z);
    if (t == 0.0) return track.point;
    if (!(abs(t) <= SOL_REACH)) {
        differential = mat3(M_INFINITY);
        return vec3(M_INFINITY);
    }
    vec3 size = abs(v);
    bool most_x = size.x >= max(size.y, size.z);
    bool most_y = !most_x && size.y >= size.z;
    vec3 along = most_x ? vec3(1.0, 0.0, 0.0) : most_y ? vec3(0.0, 1.0, 0.0) : vec3(0.0, 0.0, 1.0);
    mat3 axes = mat3(along, along.zxy, along.yzx);
    float count = sol_count(t);
    float h = t / count;
    vec4 varied[2] = vec4[2](vec4(0.0, 0.0, 0.0, axes[1].z), vec4(0.0, 0.0, 0.0, axes[2].z));
    for (float k = 0.0; k < count; k++) {
        vec3 here = sol_velocity(track);
        SolSeries series = sol_series(here);
        float rise = sol_exp(track.point.z);
        sol_vary_step(series, here, rise, axes[1].xy, h, varied[0]);
        sol_vary_step(series, here, rise, axes[2].xy, h, varied[1]);
        sol_take(track, sol_chart(series, here, h));
    }
    vec3 shares = v * axes;
    vec3 second = sol_varied(track, varied[0]) / t;
    vec3 third = sol_varied(track, varied[1]) / t;
    vec3 first = (sol_velocity(track) - shares.y * second - shares.z * third) / shares.x;
    differential = mat3(first, second, third) * transpose(axes);
    return track.point;
}

vec4 geo_base() {
    return vec4(0.0, 0.0, 0.0, 1.0);
}

float geo_inner(vec4 p, vec4 u, vec4 v) {
    return dot(u.xyz, v.xyz);
}

Geodesic geo_flow(Geodesic g, float t) {
    vec3 v = g.velocity.xyz;
    vec3 whole = vec3(0.0);
    if (abs(t) > SOL_LONG) {
        float period = sol_period(v);
        float turns = trunc(t / period);
        if (turns != 0.0) {
            whole = vec3(sol_walk(v, period).point.xy * turns, 0.0);
            t -= turns * period;
        }
    }
    if (!(abs(t) <= SOL_REACH)) return Geodesic(vec4(M_INFINITY), g.velocity);
    SolTrack track = sol_walk(v, t);
    vec3 end = sol_product(g.point.xyz, whole + track.point);
    return Geodesic(vec4(end, 1.0), vec4(sol_velocity(track), 0.0));
}

// Closed form of the plane y = 0, which is hyperbolic: velocity at the identity that reaches (x, z) in unit time.
vec2 sol_plane_log(float x, float z) {
    float scaled = sol_stretch(z, vec2(0.0, x)).y;
    float s = m_sinhcosh(0.5 * z).x;
    float length_out = 2.0 * m_asinh(0.5 * sqrt(x * scaled + 4.0 * s * s));
    float share = length_out > 1e-4 ? length_out / m_sinhcosh(length_out).x : 1.0;
    return share * vec2(scaled, 0.5 * x * scaled + m_sinhcosh(z).x);
}

vec4 geo_log(vec4 p, vec4 q, out float length_out) {
    vec3 target = sol_relative(p.xyz, q.xyz);
    vec2 first = sol_plane_log(target.x, target.z);
    vec2 second = sol_plane_log(target.y, -target.z);
    vec3 v = vec3(first.x, second.x, first.y - second.y - target.z);
    vec3 best = v;
    float least = M_INFINITY;
    for (int i = 0; i < 16; i++) {
        float size = length(v);
        mat3 differential;
        vec3 end = sol_differential(size > 0.0 ? v / size : vec3(0.0, 0.0, 1.0), size, differential);
        vec3 off = sol_relative(end, target);
        float residual = length(off);
        if (!(residual < least)) {
            // Where Newton's method no longer gains, rounding is reached; far away it may still come back.
            if (least < 1e-3 || i > 12) break;
        } else {
            best = v;
            least = residual;
        }
        vec3 change = inverse(differential) * off;
        float step = length(change);
        if (isinf(step) || isnan(step) || residual == 0.0) break;
        v += change / max(step, 1.0);
    }
    length_out = length(best);
    return length_out > 0.0 ? vec4(best / length_out, 0.0) : vec4(1.0, 0.0, 0.0, 0.0);
}

float geo_closeness(vec4 p, vec4 q) {
    return M_INFINITY;
}

float geo_area_density(Geodesic g, float t) {
    if (!(abs(t) <= SOL_REACH)) return M_INFINITY;
    mat3 m;
    vec3 v = g.velocity.xyz;
    sol_differential(v, t, m);
    return length(cross(m[1], m[2]) * v.x + cross(m[2], m[0]) * v.y + cross(m[0], m[1]) * v.z) * t * t;
}

float geo_length(Geodesic g, float u) {
    return u;
}

float geo_parameter_at(Geodesic g, float t) {
    // Finite, so that a walk without end goes on by arcs.
    return min(t, 3e38);
}

Geodesic geo_advance(Geodesic g, float u) {
    return geo_flow(g, u);
}

float geo_side(vec4 p, vec4 plane) {
    return dot(plane, p);
}

float geo_exit(Geodesic g, vec4 plane, float reach) {
    vec3 n = vec3(sol_stretch(g.point.z, plane.xy), plane.z);
    float value = geo_side(g.point, plane);
    bool on_face = value >= -IO_ON_FACE;
    if (on_face && dot(n, g.velocity.xyz) > IO_ALONG_FACE) return 0.0;
    float start = on_face ? -IO_ON_FACE + min(value, 0.0) : value;
    SolTrack track = SolTrack(g.velocity.xyz, vec3(0.0), g.velocity.z);
    vec3 v = g.velocity.xyz;
    float limit = min(reach, SOL_HORIZON);
    for (float travelled = 0.0; travelled < limit;) {
        float last = min(limit - travelled, SOL_STEP);
        SolSeries series = sol_series(v);
        // In coordinates about the step's start |x''| = 2|uw| e^z with |uw| <= 1/2, and |z''| <= 1.
        float bend = (abs(n.x) + abs(n.y)) * SOL_RISE + abs(n.z);
        // Of the form along the step, without its constant.
        float terms[SOL_TERMS];
#define SOL_FORM(k, PRODUCT) \
        terms[k] = dot(n, vec3(v.x * series.p[k], v.y * series.q[k], series.w[k])) * (1.0 / float(k + 1));
        SOL_UPWARDS(SOL_FORM)
        float s = 0.0;
        float before = -1.0;
        for (int i = 0; i < 256 && s <= last; i++) {
            float f = 0.0;
            float rate = 0.0;
#define SOL_HORNER(k)       \
            rate = rate * s + f; \
            f = f * s + terms[k];
            SOL_DOWNWARDS(SOL_HORNER)
            rate = rate * s + f;
            f = f * s + start;
            // A stride has gone too far by a stride at most, along a plane that is as close as its rounding.
            if (f >= 0.0) return travelled + (before >= 0.0 ? before : s);
            float step = m_safe_step(f, rate, bend);
            // Another step would go on by bend step^2 / rate at most.
            if (step <= 6e-8 * (1.0 + s) || bend * step * step <= 6e-8 * rate) return travelled + s + step;
            bool stride = i > M_PATIENCE && step < M_STRIDE;
            before = stride ? s : -1.0;
            s += stride ? M_STRIDE : step;
        }
        travelled += SOL_STEP;
        if (travelled >= limit) break;
        vec4 end = sol_chart(series, v, SOL_STEP);
        start += dot(n, end.xyz);
        sol_take(track, end);
        v = sol_velocity(track);
        n = vec3(sol_stretch(g.point.z + track.point.z, plane.xy), plane.z);
    }
    return M_INFINITY;
}

float geo_arc(Geodesic g, float u_max, float tolerance) {
    // The third derivative is at most (j + 2.93 h) e^h over a step: see the twin.
    vec3 v = g.velocity.xyz;
    vec3 square = v * v;
    vec2 across = v.xy * (2.0 * square.z + square.yx - square.xy);
    float third = 2.0 * length(vec3(across, v.z * (square.x + square.y)));
    float limit = min(u_max, SOL_HORIZON);
#define SOL_THIRD(h) ((third + 2.93 * (h)) * exp(h))
    M_RETURN_LONGEST_ARC(SOL_THIRD, tolerance, limit);
}

float geo_parameter(Geodesic g, vec3 c) {
    vec3 target = sol_relative(g.point.xyz, c);
    vec3 v = g.velocity.xyz;
    float s = 0.0;
    for (int i = 0; i < 10; i++) {
        SolTrack track = sol_walk(v, s);
        float step = dot(vec3(v.xy, track.w), target - track.point);
        s += step;
        if (abs(step) <= 1e-7 * (0.1 + abs(s))) break;
    }
    return s;
}

Geodesic geo_restore(Geodesic g) {
    return Geodesic(g.point, normalize(g.velocity));
}

vec3 geo_chart(vec4 p) {
    return p.xyz;
}

vec4 geo_unchart(vec3 c) {
    return vec4(c, 1.0);
}

vec4 geo_unchart_vector(vec4 p, vec3 dc) {
    return vec4(sol_stretch(-p.z, dc.xy), dc.z, 0.0);
}

vec3 geo_chart_vector(vec4 p, vec4 v) {
    return vec3(sol_stretch(p.z, v.xy), v.z);
}

vec3 geo_spray(vec3 c, vec3 v) {
    vec2 e = vec2(sol_exp(-c.z), sol_exp(c.z)) * v.xy;
    return vec3(2.0 * v.z * v.x, -2.0 * v.z * v.y, e.y * e.y - e.x * e.x);
}

vec4 geo_raise(vec4 p, vec3 conormal) {
    return vec4(normalize(vec3(sol_stretch(p.z, conormal.xy), conormal.z)), 0.0);
}

vec3 geo_lower(vec4 p, vec4 v) {
    return vec3(sol_stretch(-p.z, v.xy), v.z);
}

Geodesic geo_apply(Isometry m, Geodesic g) {
    return Geodesic(m.linear * g.point, g.velocity);
}

Geodesic geo_cross(Isometry m, vec4 plane, Geodesic g) {
    return geo_apply(m, g);
}
