// The universal cover of SL(2, R). Twin: src/geometry/sl2.rs. Contract: e3.glsl.
//
// Points (x, y, theta, w) with x^2 + y^2 - w^2 = -1 and the fibre angle not reduced, vectors in the left-invariant
// frame, chart (x/w, y/w, theta), arc length as parameter. Flow exp(t(a X1 + b X2 - c X3)) R(2ct).

const bool GEO_STRAIGHT = false;

const float SL2_HORIZON = 16.0; // longest arc; exits through planes that are not vertical are looked for so far at most

const float SL2_ALONG_WALL = 32.0 * IO_ALONG_FACE; // directions along a wall: see the twin

vec2 sl2_perp(vec2 v) {
    return vec2(-v.y, v.x);
}

float sl2_cross(vec2 a, vec2 b) {
    return a.x * b.y - a.y * b.x;
}

vec2 sl2_rotate(float angle, vec2 v) {
    vec2 sc = m_sincos(angle);
    return vec2(sc.y * v.x - sc.x * v.y, sc.x * v.x + sc.y * v.y);
}

vec4 sl2_element(vec3 c) {
    return vec4(c, sqrt(1.0 + dot(c.xy, c.xy)));
}

// kappa^2 = a^2 + b^2 - c^2 without cancellation of squares.
float sl2_square(vec3 v) {
    float radius = length(v.xy);
    return (radius - abs(v.z)) * (radius + abs(v.z));
}

// The group element p^-1 q: base point and fibre angle.
vec3 sl2_relative(vec4 p, vec4 q) {
    vec4 step = q - p;
    float along = dot(p.xy, step.xy);
    vec2 base = step.xy - p.xy * (step.w - along / (1.0 + p.w));
    float angle = m_atan(sl2_cross(p.xy, step.xy), (1.0 + p.w) * (1.0 + q.w) - dot(p.xy, q.xy));
    return vec3(sl2_rotate(-p.z, base), step.z + 2.0 * angle);
}

// The differential of the exponential map at t v, in the frames of both ends.
mat3 sl2_differential(vec3 v, float t) {
    const vec3 mirror = vec3(1.0, 1.0, -1.0);
    vec3 n = v * mirror;
    vec2 c = m_integrals(sl2_square(v) * t * t);
    mat3 m;
    for (int i = 0; i < 3; i++) {
        vec3 axis = vec3(i == 0, i == 1, i == 2);
        vec3 once = cross(n, axis * mirror) * mirror * t;
        vec3 image = axis * mirror - once * c.x + cross(n, once) * mirror * (t * c.y);
        m[i] = vec3(sl2_rotate(-2.0 * v.z * t, image.xy), image.z + 2.0 * axis.z);
    }
    return m;
}

// The differential of the chart at p.
mat3 sl2_chart_differential(vec4 p) {
    mat3 m = mat3(0.0);
    m[2].z = 1.0;
    vec2 k = p.xy / p.w;
    for (int i = 0; i < 2; i++) {
        vec2 v = sl2_rotate(p.z, vec2(i == 0, i == 1));
        float along = dot(p.xy, v);
        vec2 moved = v + p.xy * (along / (1.0 + p.w));
        m[i] = vec3((moved - k * along) / p.w, sl2_cross(v, p.xy) / (1.0 + p.w));
    }
    return m;
}

vec4 geo_base() {
    return vec4(0.0, 0.0, 0.0, 1.0);
}

float geo_inner(vec4 p, vec4 u, vec4 v) {
    return dot(u.xyz, v.xyz);
}

Geodesic geo_flow(Geodesic g, float t) {
    vec4 p = g.point;
    float c = g.velocity.z;
    vec2 v = sl2_rotate(p.z, g.velocity.xy);
    float square = sl2_square(g.velocity.xyz);
    // Half-turns of the first factor are taken out, so that the rest has C >= 0.
    float angle = 0.5 * t * sqrt(abs(min(square, 0.0)));
    float turns = floor(angle / M_PI + 0.5);
    vec2 cs; // C and S
    if (turns == 0.0) {
        cs = m_cosh_sinhc(0.25 * square * t * t);
        cs.y *= t;
    } else {
        vec2 sc = m_sincos(m_reduce(angle, 2.0 * turns, M_HALF_PI_PARTS));
        cs = vec2(sc.y, t * sc.x / angle);
    }
    vec2 horizontal = cs.y * (v * cs.x - sl2_perp(v) * (0.5 * c * cs.y));
    float rest = 0.5 * cs.y * cs.y * dot(v, v);
    float along = dot(p.xy, horizontal);
    vec2 base = p.xy + horizontal + p.xy * (rest + along / (1.0 + p.w));
    float w = p.w + along + p.w * rest;
    float real = (1.0 + p.w) * cs.x + 0.5 * dot(p.xy, v) * cs.y;
    float imaginary = 0.5 * cs.y * (sl2_cross(v, p.xy) - (1.0 + p.w) * c);
    float wound = 2.0 * c * t - turns * (2.0 * M_PI) * sign(c);
    float fibre = p.z + (wound + 2.0 * m_atan(imaginary, real));
    return Geodesic(vec4(base, fibre, w), vec4(sl2_rotate(-2.0 * c * t, g.velocity.xy), c, 0.0));
}

// For half of the base distance and the angle y of the first factor (hyperbolic for y < 0): horizontal and vertical
// components, and half of the first factor's turn.
vec3 sl2_regime(float sinh_half, float y) {
    vec2 cs = m_cosh_sinhc(-y * abs(y));
    float sine = y * cs.y;
    float vertical = 2.0 * sqrt(max(sinh_half * sinh_half + sine * abs(sine), 0.0)) / cs.y;
    return vec3(2.0 * sinh_half / cs.y, vertical, m_atan(0.5 * vertical * cs.y, cs.x));
}

vec4 geo_log(vec4 p, vec4 q, out float length_out) {
    vec3 target = sl2_relative(p, q);
    float radius = length(target.xy);
    float sinh_half = radius / sqrt(2.0 * (1.0 + sqrt(1.0 + radius * radius)));
    float angle = abs(target.z);
    float low = -m_asinh(sinh_half);
    float high = M_PI;
    for (int i = 0; i < 24; i++) {
        float middle = 0.5 * (low + high);
        vec3 r = sl2_regime(sinh_half, middle);
        if (2.0 * (r.y - r.z) < angle) low = middle; else high = middle;
    }
    float y = 0.5 * (low + high);
    vec3 r = sl2_regime(sinh_half, y);
    if (y > M_HALF_PI) {
        // Next to the conjugate point the fibre angle says more than the base distance.
        r.y = 0.5 * angle + r.z;
        r.x = sqrt(max(r.y * r.y - 4.0 * y * y, 0.0));
    }
    if (target.z < 0.0) r.yz = -r.yz;
    vec2 towards = radius > 0.0 ? target.xy / radius : vec2(1.0, 0.0);
    vec3 v = vec3(sl2_rotate(r.z, towards) * r.x, r.y);
    vec4 goal = sl2_element(target);
    vec3 best = v;
    float least = M_INFINITY;
    for (int i = 0; i < 5; i++) {
        vec3 off = sl2_relative(geo_flow(Geodesic(geo_base(), vec4(v, 0.0)), 1.0).point, goal);
        float residual = length(off);
        if (!(residual < least)) break;
        best = v;
        least = residual;
        vec3 change = inverse(sl2_differential(v, 1.0)) * off;
        float step = length(change);
        if (isinf(step) || isnan(step)) break;
        v += change / max(step, 1.0);
    }
    length_out = length(best);
    return length_out > 0.0 ? vec4(best / length_out, 0.0) : vec4(1.0, 0.0, 0.0, 0.0);
}

float geo_closeness(vec4 p, vec4 q) {
    return M_INFINITY;
}

float geo_area_density(Geodesic g, float t) {
    vec3 v = g.velocity.xyz;
    mat3 m = sl2_differential(v, t);
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
    return dot(plane.xy, p.xy) + (plane.z * p.z + plane.w) * p.w;
}

vec3 geo_chart(vec4 p) {
    return vec3(p.xy / p.w, p.z);
}

vec4 geo_unchart(vec3 c) {
    float r = length(c.xy);
    float w = inversesqrt((1.0 - r) * (1.0 + r));
    return vec4(c.xy * w, c.z, w);
}

vec3 geo_chart_vector(vec4 p, vec4 v) {
    return sl2_chart_differential(p) * v.xyz;
}

float geo_exit(Geodesic g, vec4 plane, float reach) {
    vec4 p = g.point;
    if (plane.z == 0.0) {
        // A vertical plane: the form in coordinates about the base of p.
        vec2 v = sl2_rotate(p.z, g.velocity.xy);
        float c = g.velocity.z;
        float along = dot(plane.xy, p.xy);
        vec2 n = plane.xy + p.xy * (plane.w + along / (1.0 + p.w));
        float start = along + plane.w * p.w;
        float bend = 2.0 * c * sl2_cross(n, v) + start * (dot(v, v) + c * c);
        float rate = dot(n, v);
        bool on_wall = abs(start) <= IO_ON_FACE;
        bool along_wall = abs(rate) <= SL2_ALONG_WALL;
        // A state that keeps to its wall, as along an upright edge, does not leave through it.
        if (on_wall && along_wall && bend <= SL2_ALONG_WALL) return M_INFINITY;
        if (on_wall) start = 0.0;
        if (along_wall) rate = 0.0;
        return m_first_passage(sl2_square(g.velocity.xyz), start, rate, bend, IO_ALONG_FACE);
    }
    float threshold = 0.0;
    float bend = 2.0 * length(plane.xy) + 0.75 * abs(plane.z);
    float s = 0.0;
    float before = -1.0;
    for (int i = 0; i < 4096 && s <= min(reach, SL2_HORIZON); i++) {
        Geodesic at = geo_flow(g, s);
        float value = dot(plane.xyz, geo_chart(at.point)) + plane.w;
        float rate = dot(plane.xyz, sl2_chart_differential(at.point) * at.velocity.xyz);
        // Whether the state is on its plane is judged as the walk judges whether it is outside.
        if (i == 0 && value * p.w >= -IO_ON_FACE) {
            if (rate > IO_ALONG_FACE) return 0.0;
            threshold = IO_ON_FACE + max(value * p.w, 0.0);
        }
        value -= threshold;
        // A stride has gone too far by a stride at most, along a plane that is as close as its rounding.
        if (value >= 0.0) return before >= 0.0 ? before : s;
        float step = m_safe_step(value, rate, bend);
        if (step <= 6e-8 * (1.0 + s)) return s;
        bool stride = i > M_PATIENCE && step < M_STRIDE;
        before = stride ? s : -1.0;
        s += stride ? M_STRIDE : step;
    }
    return M_INFINITY;
}

// The third derivative of the chart at the start: see the twin.
vec3 sl2_third_derivative(vec4 p, vec2 v, float c) {
    float square = dot(v, v);
    vec2 bent = -c * sl2_perp(v);
    // The base point's derivatives in the hyperboloid.
    float along = dot(p.xy, v);
    vec3 first = vec3(v + p.xy * (along / (1.0 + p.w)), along);
    along = dot(p.xy, bent);
    vec3 second = vec3(bent + p.xy * (square + along / (1.0 + p.w)), along + p.w * square);
    vec3 third = first * (square - c * c);
    vec2 xi = p.xy / p.w;
    vec2 xi_1 = (first.xy - xi * first.z) / p.w;
    vec2 xi_2 = (second.xy - xi * second.z - 2.0 * first.z * xi_1) / p.w;
    vec2 xi_3 = (third.xy - xi * third.z - 3.0 * first.z * xi_2 - 3.0 * second.z * xi_1) / p.w;
    float area = sl2_cross(first.xy, p.xy);
    float area_1 = sl2_cross(second.xy, p.xy);
    float area_2 = sl2_cross(third.xy, p.xy) + sl2_cross(second.xy, first.xy);
    float share = 1.0 / (1.0 + p.w);
    float share_1 = -first.z * share * share;
    float share_2 = share * share * (2.0 * first.z * first.z * share - second.z);
    return vec3(xi_3, area_2 * share + 2.0 * area_1 * share_1 + area * share_2);
}

// Metric length of a vector of the chart.
float sl2_frame_length(vec4 p, vec3 dc) {
    vec2 xi = p.xy / p.w;
    float rise = p.w * p.w * p.w * dot(xi, dc.xy);
    vec2 step = dc.xy * p.w + xi * rise;
    vec2 horizontal = step - p.xy * (rise - dot(p.xy, step) / (1.0 + p.w));
    return length(vec3(horizontal, dc.z - sl2_cross(horizontal, p.xy) / (1.0 + p.w)));
}

// Bound of the third derivative over a step h: see the twin.
float sl2_third(float third, float speed, float distance, float h) {
    float rate = min(0.31 + 2.0 * distance, 2.0);
    float way = speed * h;
    float risen = min(way, 1.0 - 0.5 * rate);
    return (third + 6.12 * speed * way) * exp(rate * way + risen * (2.0 * way - risen));
}

float geo_arc(Geodesic g, float u_max, float tolerance) {
    vec4 p = g.point;
    vec2 v = sl2_rotate(p.z, g.velocity.xy);
    float speed = length(v);
    float distance = length(p.xy) / p.w;
    float third = sl2_frame_length(p, sl2_third_derivative(p, v, g.velocity.z));
    float limit = min(u_max, SL2_HORIZON);
#define SL2_THIRD(h) sl2_third(third, speed, distance, h)
    M_RETURN_LONGEST_ARC(SL2_THIRD, tolerance, limit);
}

float geo_parameter(Geodesic g, vec3 c) {
    float s = 0.0;
    for (int i = 0; i < 12; i++) {
        Geodesic at = geo_flow(g, s);
        vec3 off = inverse(sl2_chart_differential(at.point)) * (c - geo_chart(at.point));
        float step = dot(off, at.velocity.xyz);
        if (isinf(step) || isnan(step)) break;
        s += step;
        if (abs(step) <= 1e-7 * (0.1 + abs(s))) break;
    }
    return s;
}

Geodesic geo_restore(Geodesic g) {
    return Geodesic(sl2_element(g.point.xyz), normalize(g.velocity));
}

vec4 geo_unchart_vector(vec4 p, vec3 dc) {
    return vec4(inverse(sl2_chart_differential(p)) * dc, 0.0);
}

vec3 geo_spray(vec3 c, vec3 v) {
    float square = 1.0 / ((1.0 - length(c.xy)) * (1.0 + length(c.xy)));
    float w = sqrt(square);
    vec2 x = c.xy * w;
    vec2 a = w * (v.xy + x * (dot(x, v.xy) / (1.0 + w)));
    float fibre = v.z - sl2_cross(a, x) / (1.0 + w);
    vec2 turn = -sl2_perp(a);
    vec2 bend = (turn - x * (dot(x, turn) / (w * (1.0 + w)))) * (fibre / w);
    vec2 straight = -2.0 * square * dot(c.xy, v.xy) * v.xy;
    return vec3(straight + bend, (2.0 * fibre - v.z) * dot(x, a) / (1.0 + w));
}

vec4 geo_raise(vec4 p, vec3 conormal) {
    return vec4(normalize(conormal * sl2_chart_differential(p)), 0.0);
}

vec3 geo_lower(vec4 p, vec4 v) {
    return v.xyz * inverse(sl2_chart_differential(p));
}

Geodesic geo_apply(Isometry m, Geodesic g) {
    vec4 p = g.point;
    vec4 base = m.linear * vec4(p.xy, 0.0, p.w);
    vec4 left = m.linear[3];
    // -1 for a mirror image, which turns the fibre round.
    float round = m.linear[2].z;
    vec2 right = sl2_rotate(m.shift.z, vec2(p.x, round * p.y));
    float angle = 2.0 * m_atan(sl2_cross(right, left.xy), (1.0 + left.w) * (1.0 + p.w) + dot(left.xy, right));
    return Geodesic(vec4(base.xy, m.shift.z + round * p.z + angle, base.w), g.velocity * vec4(1.0, round, round, 1.0));
}

// The image of a state on a plane over a line of the base under its reflection: the base is hardly moved.
Geodesic sl2_reflected(vec4 plane, Geodesic g) {
    vec4 p = g.point;
    vec2 n = plane.xy;
    float share = 2.0 / (dot(n, n) - plane.w * plane.w);
    float step = share * (dot(n, p.xy) + plane.w * p.w);
    // Where the origin goes, and the base reflected at the origin.
    vec2 left = n * (-share * plane.w);
    float left_w = 1.0 + share * plane.w * plane.w;
    vec2 right = p.xy - n * (2.0 * dot(n, p.xy) / dot(n, n));
    float angle = 2.0 * m_atan(sl2_cross(right, left), (1.0 + left_w) * (1.0 + p.w) + dot(left, right));
    float fibre = 2.0 * m_atan(n.y, n.x) + M_PI - p.z + angle;
    return Geodesic(vec4(p.xy - n * step, fibre, p.w + plane.w * step), g.velocity * vec4(1.0, -1.0, -1.0, 1.0));
}

Geodesic geo_cross(Isometry m, vec4 plane, Geodesic g) {
    bool is_wall = plane.z == 0.0 && dot(plane.xy, plane.xy) > plane.w * plane.w;
    return geo_apply(m, is_wall ? sl2_reflected(plane, g) : g);
}
