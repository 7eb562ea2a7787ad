// Integrators of the equation of geodesics in the chart: c'' = geo_spray(c, c'). Twin, with the theory: src/integrate/.
//
// A step is a polynomial r0 + x (r1 + (1 - x) (r2 + x (r3 + (1 - x) r4))) in the share x of the step, for coordinates and
// for velocities; the first two coefficients alone are a chord, the first four Hermite's cubic.
#ifndef INTEGRATE_GLSL
#define INTEGRATE_GLSL
#include "shared/io.glsl"
#include "shared/types.glsl"
#include "shared/math.glsl"
#include "GEOMETRY"

// A point of a geodesic in the chart: coordinates and their derivative by arc length.
struct ChartState {
    vec3 c;
    vec3 v;
};

struct Dense {
    float h;
    vec3 c[5];
    vec3 v[5];
};

vec3 dense_nested(vec3 r[5], float share) {
    float rest = 1.0 - share;
    return r[0] + share * (r[1] + rest * (r[2] + share * (r[3] + rest * r[4])));
}

ChartState dense_at(Dense dense, float share) {
    return ChartState(dense_nested(dense.c, share), dense_nested(dense.v, share));
}

ChartState integrate_state(Geodesic g) {
    return ChartState(geo_chart(g.point), geo_chart_vector(g.point, g.velocity));
}

// Not a number where the chart does not reach.
Geodesic integrate_geodesic(ChartState state) {
    vec4 point = geo_unchart(state.c);
    return Geodesic(point, geo_unchart_vector(point, state.v));
}

bool integrate_finite(ChartState state) {
    vec3 sum = abs(state.c) + abs(state.v);
    return sum.x + sum.y + sum.z < 3e38;
}

Dense integrate_hermite(ChartState start, vec3 a0, ChartState end, vec3 a1, float h) {
    Dense dense;
    dense.h = h;
    vec3 way = end.c - start.c;
    vec3 second = h * start.v - way;
    dense.c = vec3[5](start.c, way, second, way - h * end.v - second, vec3(0.0));
    way = end.v - start.v;
    second = h * a0 - way;
    dense.v = vec3[5](start.v, way, second, way - h * a1 - second, vec3(0.0));
    return dense;
}

Dense integrate_euler(ChartState start, float h) {
    Dense dense;
    dense.h = h;
    dense.c = vec3[5](start.c, h * start.v, vec3(0.0), vec3(0.0), vec3(0.0));
    dense.v = vec3[5](start.v, h * geo_spray(start.c, start.v), vec3(0.0), vec3(0.0), vec3(0.0));
    return dense;
}

Dense integrate_rk4(ChartState start, float h) {
    vec3 c = start.c;
    vec3 v = start.v;
    vec3 a1 = geo_spray(c, v);
    vec3 v2 = v + 0.5 * h * a1;
    vec3 a2 = geo_spray(c + 0.5 * h * v, v2);
    vec3 v3 = v + 0.5 * h * a2;
    vec3 a3 = geo_spray(c + 0.5 * h * v2, v3);
    vec3 v4 = v + h * a3;
    vec3 a4 = geo_spray(c + h * v3, v4);
    ChartState end = ChartState(c + h / 6.0 * (v + 2.0 * (v2 + v3) + v4), v + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4));
    return integrate_hermite(start, a1, end, geo_spray(end.c, end.v), h);
}

// Largest component of an error, relative to 1 plus the size of what is in error.
float integrate_share(vec3 error, vec3 from, vec3 to) {
    vec3 share = abs(error) / (1.0 + max(abs(from), abs(to)));
    return max(share.x, max(share.y, share.z));
}

// Dormand and Prince's step of order 5 with its continuous extension, and its error.
Dense integrate_dopri5(ChartState start, float h, out float error) {
    vec3 c = start.c;
    vec3 v = start.v;
    vec3 a1 = geo_spray(c, v);
    vec3 v2 = v + h / 5.0 * a1;
    vec3 a2 = geo_spray(c + h / 5.0 * v, v2);
    vec3 v3 = v + h * (3.0 / 40.0 * a1 + 9.0 / 40.0 * a2);
    vec3 a3 = geo_spray(c + h * (3.0 / 40.0 * v + 9.0 / 40.0 * v2), v3);
    vec3 v4 = v + h * (44.0 / 45.0 * a1 - 56.0 / 15.0 * a2 + 32.0 / 9.0 * a3);
    vec3 a4 = geo_spray(c + h * (44.0 / 45.0 * v - 56.0 / 15.0 * v2 + 32.0 / 9.0 * v3), v4);
    const vec4 w5 = vec4(19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0);
    vec3 v5 = v + h * (w5.x * a1 + w5.y * a2 + w5.z * a3 + w5.w * a4);
    vec3 a5 = geo_spray(c + h * (w5.x * v + w5.y * v2 + w5.z * v3 + w5.w * v4), v5);
    const vec4 w6 = vec4(9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0);
    const float w65 = -5103.0 / 18656.0;
    vec3 v6 = v + h * (w6.x * a1 + w6.y * a2 + w6.z * a3 + w6.w * a4 + w65 * a5);
    vec3 a6 = geo_spray(c + h * (w6.x * v + w6.y * v2 + w6.z * v3 + w6.w * v4 + w65 * v5), v6);
    const vec4 w7 = vec4(35.0 / 384.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0);
    const float w76 = 11.0 / 84.0;
    ChartState end = ChartState(c + h * (w7.x * v + w7.y * v3 + w7.z * v4 + w7.w * v5 + w76 * v6),
                                v + h * (w7.x * a1 + w7.y * a3 + w7.z * a4 + w7.w * a5 + w76 * a6));
    vec3 a7 = geo_spray(end.c, end.v);
    Dense dense = integrate_hermite(start, a1, end, a7, h);
    const vec3 d1 = vec3(-12715105075.0 / 11282082432.0, 87487479700.0 / 32700410799.0, -10690763975.0 / 1880347072.0);
    const vec3 d2 = vec3(701980252875.0 / 199316789632.0, -1453857185.0 / 822651844.0, 69997945.0 / 29380423.0);
    dense.c[4] = h * (d1.x * v + d1.y * v3 + d1.z * v4 + d2.x * v5 + d2.y * v6 + d2.z * end.v);
    dense.v[4] = h * (d1.x * a1 + d1.y * a3 + d1.z * a4 + d2.x * a5 + d2.y * a6 + d2.z * a7);
    const vec3 e1 = vec3(71.0 / 57600.0, -71.0 / 16695.0, 71.0 / 1920.0);
    const vec3 e2 = vec3(-17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0);
    vec3 off_c = h * (e1.x * v + e1.y * v3 + e1.z * v4 + e2.x * v5 + e2.y * v6 + e2.z * end.v);
    vec3 off_v = h * (e1.x * a1 + e1.y * a3 + e1.z * a4 + e2.x * a5 + e2.y * a6 + e2.z * a7);
    error = max(integrate_share(off_c, c, end.c), integrate_share(off_v, v, end.v));
    if (!integrate_finite(end) || isnan(error)) error = M_INFINITY;
    return dense;
}

// One step of length h, whatever it costs in accuracy.
Dense integrate_step(uint method, ChartState start, float h) {
    if (method == IO_INTEGRATOR_EULER) return integrate_euler(start, h);
    if (method == IO_INTEGRATOR_RK4) return integrate_rk4(start, h);
    float error;
    return integrate_dopri5(start, h, error);
}

// A step of at most `limit` (either sign) that the method accepts, where `proposal` is what the last one proposed (0 at
// the start), and the proposal for the next. False: there is no such step.
bool integrate_advance(uint method, float parameter, ChartState start, inout float proposal, float limit, out Dense dense) {
    float longest = abs(limit);
    if (method != IO_INTEGRATOR_DOPRI5) {
        dense = integrate_step(method, start, parameter < longest ? (limit < 0.0 ? -parameter : parameter) : limit);
        return true;
    }
    float h = proposal > 0.0 ? proposal : 0.1;
    for (int i = 0; i < 60; i++) {
        float error;
        dense = integrate_dopri5(start, h < longest ? (limit < 0.0 ? -h : h) : limit, error);
        // Below some roundings no step is short enough.
        error /= max(parameter, 4.0 * 1.1920929e-7);
        float taken = min(h, longest);
        float factor = error > 0.0 ? clamp(0.9 * pow(error, -0.2), 0.2, 5.0) : 5.0;
        if (error <= 1.0) {
            // A step that the limit has cut says nothing against the longer one.
            proposal = max(taken * factor, h > longest ? h : 0.0);
            return true;
        }
        h = taken * min(factor, 0.9);
    }
    return false;
}

// Follows a geodesic for length t, of either sign. Infinite where the chart does not reach so far.
Geodesic integrate_follow(uint method, float parameter, Geodesic g, float t) {
    ChartState state = integrate_state(g);
    float rest = t;
    float proposal = 0.0;
    for (uint i = 0u; rest != 0.0; i++) {
        Dense dense;
        bool found = i < IO_INTEGRATE_STEPS && integrate_advance(method, parameter, state, proposal, rest, dense);
        float left = rest - dense.h;
        bool moved = rest == dense.h || state.c != dense.c[0] + dense.c[1] || state.v != dense.v[0] + dense.v[1];
        state = ChartState(dense.c[0] + dense.c[1], dense.v[0] + dense.v[1]);
        // A step that is lost in rounding would be made for ever.
        if (!found || left == rest || !moved || !integrate_finite(state)) return Geodesic(vec4(M_INFINITY), vec4(0.0));
        rest = left;
    }
    return integrate_geodesic(state);
}

#endif
