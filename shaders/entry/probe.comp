// One function of the geometry per invocation, on arrays of inputs: the tests compare it with its Rust twin, and
// `holonomy geodesic --backend compute` runs geodesics through it.
#include "shared/io.glsl"
#include "shared/types.glsl"
#include "shared/math.glsl"
#include "GEOMETRY"
#include "shared/integrate.glsl"

layout(local_size_x = IO_PROBE_GROUP) in;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= uint(io_probe_in.length())) return;
    ProbeIn q = io_probe_in[i];
    Geodesic g = Geodesic(q.a, q.b);
    Geodesic r = Geodesic(vec4(0.0), vec4(0.0));
    switch (q.op) {
    case IO_PROBE_FLOW: r = geo_flow(g, q.t); break;
    case IO_PROBE_INNER: r.point.x = geo_inner(q.a, q.b, q.c); break;
    case IO_PROBE_LOG: r.velocity = geo_log(q.a, q.b, r.point.x); break;
    case IO_PROBE_AREA_DENSITY: r.point.x = geo_area_density(g, q.t); break;
    case IO_PROBE_LENGTH: r.point.x = geo_length(g, q.t); break;
    case IO_PROBE_PARAMETER_AT: r.point.x = geo_parameter_at(g, q.t); break;
    case IO_PROBE_ADVANCE: r = geo_advance(g, q.t); break;
    case IO_PROBE_EXIT: r.point.x = geo_exit(g, q.c, q.t); break;
    case IO_PROBE_ARC: r.point.x = geo_arc(g, q.c.x, q.t); break;
    case IO_PROBE_PARAMETER: r.point.x = geo_parameter(g, q.c.xyz); break;
    case IO_PROBE_RESTORE: r = geo_restore(g); break;
    case IO_PROBE_CHART: r.point.xyz = geo_chart(q.a); break;
    case IO_PROBE_UNCHART: r.point = geo_unchart(q.a.xyz); break;
    case IO_PROBE_RAISE: r.point = geo_raise(q.a, q.b.xyz); break;
    case IO_PROBE_APPLY: r = geo_apply(Isometry(mat4(io_faces[0].linear), io_faces[0].shift), g); break;
    case IO_PROBE_SIDE: r.point.x = geo_side(q.a, q.c); break;
    case IO_PROBE_CLOSENESS: r.point.x = geo_closeness(q.a, q.b); break;
    case IO_PROBE_CROSS: r = geo_cross(Isometry(mat4(io_faces[0].linear), io_faces[0].shift), q.c, g); break;
    case IO_PROBE_BASE: r.point = geo_base(); break;
    case IO_PROBE_CHART_VECTOR: r.point.xyz = geo_chart_vector(q.a, q.b); break;
    case IO_PROBE_LOWER: r.point.xyz = geo_lower(q.a, q.b); break;
    case IO_PROBE_UNCHART_VECTOR: r.point = geo_unchart_vector(q.a, q.b.xyz); break;
    case IO_PROBE_SPRAY: r.point.xyz = geo_spray(q.a.xyz, q.b.xyz); break;
    case IO_PROBE_STEP: {
        Dense dense = integrate_step(uint(q.c.x), ChartState(q.a.xyz, q.b.xyz), q.t);
        ChartState state = dense_at(dense, q.c.y);
        r = Geodesic(vec4(state.c, 0.0), vec4(state.v, 0.0));
        break;
    }
    case IO_PROBE_FOLLOW: r = integrate_follow(uint(q.c.x), q.c.y, g, q.t); break;
    }
    io_probe_out[i] = ProbeOut(r.point, r.velocity);
}
