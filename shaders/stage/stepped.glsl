// Walking a geodesic by an integrator instead of the geometry's flow: each step of the integrator is one segment. Twin,
// with the theory: src/space/stepped.rs.
//
// The path's state is in the chart meanwhile: point.xyz and velocity.xyz are coordinates and their derivative, point.w is
// the integrator's proposal for the next step, velocity.w the whole step of which the segment is the first part.
#ifndef STEPPED_GLSL
#define STEPPED_GLSL
#include "shared/integrate.glsl"

// Longest step: a face may be passed twice within a longer one, in cells of size 1, which its end would not show.
const float STEPPED_LONGEST = 0.5;

ChartState stepped_state(Path path) {
    return ChartState(path.point.xyz, path.velocity.xyz);
}

// Takes the path through a face.
void stepped_cross(inout Path path, ChartState state, uint face) {
    Geodesic g = geo_cross(Isometry(io_faces[face].linear, io_faces[face].shift), io_faces[face].plane,
                           integrate_geodesic(state));
    state = integrate_state(g);
    path.point.xyz = state.c;
    path.velocity.xyz = state.v;
    walk_passed(path, face);
    if (!integrate_finite(state)) path.status = PATH_GONE;
}

// First share of the step at which it passes out through the plane; infinite if it ends inside.
float stepped_exit(Dense dense, vec4 plane) {
    vec3 n = plane.xyz;
    float r0 = dot(n, dense.c[0]) + plane.w;
    float r1 = dot(n, dense.c[1]);
    if (!(r0 + r1 > 0.0)) return M_INFINITY;
    float r2 = dot(n, dense.c[2]);
    float r3 = dot(n, dense.c[3]);
    float r4 = dot(n, dense.c[4]);
    if (r2 == 0.0 && r3 == 0.0 && r4 == 0.0) return r0 < 0.0 ? -r0 / r1 : r1 > 0.0 ? 0.0 : M_INFINITY;
    float low = 0.0;
    float f_low = r0;
    if (r0 >= -IO_ON_FACE) {
        if (r1 + r2 > 0.0) return 0.0;
        // From the plane inwards and back out again: its passage is not the start.
        for (int i = 1; i < 8 && f_low >= -IO_ON_FACE; i++) {
            low = 0.125 * float(i);
            float rest = 1.0 - low;
            f_low = r0 + low * (r1 + rest * (r2 + low * (r3 + rest * r4)));
        }
        if (f_low >= -IO_ON_FACE) return M_INFINITY;
    }
    // Regula falsi, an end that stays twice counting half (the Illinois method). Among values that are rounding alone it would
    // walk away again: the best is kept.
    float high = 1.0;
    float f_high = r0 + r1;
    float best = high;
    float least = f_high;
    int last = 0;
    float rounding = 1.2e-7 * (abs(r0) + abs(r1) + abs(plane.w));
    for (int i = 0; i < 16; i++) {
        float share = clamp(high - f_high * (high - low) / (f_high - f_low), low, high);
        float rest = 1.0 - share;
        float f = r0 + share * (r1 + rest * (r2 + share * (r3 + rest * r4)));
        if (abs(f) < least) {
            least = abs(f);
            best = share;
        }
        if (least <= rounding || high - low < 1e-7) break;
        if (f > 0.0) {
            high = share;
            f_high = f;
            if (last > 0) f_low *= 0.5;
            last = 1;
        } else {
            low = share;
            f_low = f;
            if (last < 0) f_high *= 0.5;
            last = -1;
        }
    }
    return best;
}

// Largest share of the step up to which the arc stays within the tolerance of the polynomial. Its third derivative is
// taken for constant.
float stepped_share(Dense dense, float tolerance) {
    if (GEO_STRAIGHT) return 1.0;
    float change = dense.h * length(2.0 * dense.v[2] + dense.v[3]);
    return pow(96.0 * tolerance / max(change, 1e-30), 1.0 / 3.0);
}

// The segment of the first part of a step: straight for Euler's method, else the arc with the same ends and change of
// velocity.
Segment stepped_piece(Dense dense, float share) {
    ChartState end = dense_at(dense, share);
    Segment segment = Segment(dense.c[0], end.c - dense.c[0], vec3(0.0));
    if (!GEO_STRAIGHT && IO_INTEGRATOR != IO_INTEGRATOR_EULER) segment.bend = 0.5 * share * dense.h * (dense.v[0] - end.v);
    return segment;
}

// Cuts an accepted step to where its segment is within the tolerance of pictures, if the method leaves the step to a tolerance.
void stepped_shorten(ChartState start, float tolerance, inout float proposal, inout Dense dense) {
    if (IO_INTEGRATOR != IO_INTEGRATOR_DOPRI5) return;
    float share = stepped_share(dense, tolerance);
    if (share >= 1.0) return;
    dense = integrate_step(IO_INTEGRATOR, start, share * dense.h);
    proposal = dense.h;
}

bool stepped_segment(inout Path path, float limit, uint bounces, bool first, out Segment segment) {
    if (first) {
        ChartState start = integrate_state(walk_state(path));
        path.point = vec4(start.c, 0.0);
        path.velocity = vec4(start.v, 0.0);
    }
    uint face = 0u;
    uint end_face = IO_FACES;
    for (uint attempt = 0u;; attempt++) {
        if (IO_FACES == 0u) {
            face = io_cells[path.cell].first_face;
            end_face = face + io_cells[path.cell].face_count;
        } else {
            face = 0u;
        }
        float worst = IO_ON_FACE;
        uint violated = IO_END_LIMIT;
        for (; face < end_face; face++) {
            float side = dot(io_faces[face].plane, vec4(path.point.xyz, 1.0));
            if (side > worst) {
                worst = side;
                violated = face;
            }
        }
        if (violated == IO_END_LIMIT) break;
        bool lost = attempt == IO_REDUCE_LIMIT;
        if (lost) count(IO_COUNT_LOST);
        if (lost || path.bounces == bounces) path.status = PATH_GONE;
        if (path.status != PATH_GONE) stepped_cross(path, stepped_state(path), violated);
        if (path.status == PATH_GONE) return false;
    }
    ChartState start = stepped_state(path);
    float rest = limit - path.travelled;
    Dense dense;
    bool endless = isinf(limit) && IO_FACES == 0u && io_cells[path.cell].face_count == 0u;
    if (endless || !integrate_advance(IO_INTEGRATOR, io_view[0].integration, start, path.point.w,
                                       min(rest, STEPPED_LONGEST), dense)) {
        path.status = PATH_GONE;
        return false;
    }
    if (IO_INTEGRATOR != IO_INTEGRATOR_EULER) stepped_shorten(start, walk_tolerance(path), path.point.w, dense);
    path.end = dense.h < rest ? IO_END_ARC : IO_END_LIMIT;
    float share = 1.0;
    if (IO_FACES == 0u) face = io_cells[path.cell].first_face; else face = 0u;
    for (; face < end_face; face++) {
        float exit = stepped_exit(dense, io_faces[face].plane);
        if (exit <= share) {
            share = exit;
            path.end = face;
        }
    }
    vec3 end = dense_nested(dense.c, share);
    if (!integrate_finite(ChartState(end, dense.v[0] + dense.v[1]))) {
        path.status = PATH_GONE;
        return false;
    }
    path.velocity.w = dense.h;
    path.u_end = share * dense.h;
    path.segments++;
    segment = segment_extended(stepped_piece(dense, share), first);
    return true;
}

void stepped_transport(inout Path path, uint bounces) {
    path.travelled += path.u_end;
    ChartState state = dense_at(integrate_step(IO_INTEGRATOR, stepped_state(path), path.velocity.w),
                                path.u_end / path.velocity.w);
    if (path.end < IO_END_ARC && path.bounces < bounces) {
        stepped_cross(path, state, path.end);
        return;
    }
    path.point.xyz = state.c;
    path.velocity.xyz = state.v;
    if (path.end != IO_END_ARC) path.status = PATH_GONE;
}

#endif
