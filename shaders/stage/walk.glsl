// Walking a geodesic through the cells: segments for traversal, and transport through the faces.
//
// A path alternates between two steps. `stage_segment` finds how far the geodesic goes before it leaves the cell
// (or the arc's tolerance, or its largest length) and gives the segment of the chart to traversal; if
// that meets nothing, the miss stage `stage_transport` moves the state to the segment's end and, at a face,
// applies the pairing to point and velocity. Nothing here knows the geometry or the backend.
#ifndef WALK_GLSL
#define WALK_GLSL
#include "shared/io.glsl"
#include "shared/types.glsl"
#include "shared/math.glsl"
#include "shared/count.glsl"
#include "GEOMETRY"

const uint PATH_FLYING = 0u;
const uint PATH_HIT = 1u;
const uint PATH_GONE = 2u;

// State of a ray between two segments; what the ray tracing pipeline carries from stage to stage (64 bytes). While a
// segment is traced, an arc's state is that of its end: it is known already, and transport needs it.
struct Path {
    vec4 point;     // where the current segment starts or, on an arc, ends, in the cell's coordinates
    vec4 velocity;  // unit tangent vector there
    float travelled; // geodesic length from the source to the segment's start
    float u_end;    // curve parameter of the segment's end
    uint end;       // face at the segment's end (index into all faces), IO_END_ARC or IO_END_LIMIT
    uint cell;
    uint bounces;   // faces passed
    uint segments;  // segments begun
    uint label;     // deck element of the cell, IO_NONE beyond the table
    uint status;
};

// What traversal gets of a path: c(s) = origin + s direction + s (1 - s) bend, s in [0, 1], in the chart. An arc of a
// parabola; straight, with no bend, where GEO_STRAIGHT.
struct Segment {
    vec3 origin;
    vec3 direction;
    vec3 bend;
};

vec3 segment_at(Segment segment, float s) {
    vec3 chord = segment.origin + s * segment.direction;
    return GEO_STRAIGHT ? chord : chord + s * (1.0 - s) * segment.bend;
}

vec3 segment_tangent(Segment segment, float s) {
    return GEO_STRAIGHT ? segment.direction : segment.direction + (1.0 - 2.0 * s) * segment.bend;
}

// The largest value that the form of a plane may have on a segment: no less than at any of its points.
float segment_highest(Segment segment, vec4 plane) {
    float start = dot(plane.xyz, segment.origin) + plane.w;
    return max(start, start + dot(plane.xyz, segment.direction)) + 0.25 * max(dot(plane.xyz, segment.bend), 0.0);
}

// The segment from g to `end` at curve parameter u: its ends are the curve's, and so is the difference of its velocities
// there (Segment::along in src/geometry/mod.rs).
Segment segment_between(Geodesic g, Geodesic end, float u) {
    vec3 origin = geo_chart(g.point);
    Segment segment = Segment(origin, geo_chart(end.point) - origin, vec3(0.0));
    if (!GEO_STRAIGHT) {
        segment.bend = 0.5 * u * (geo_chart_vector(g.point, g.velocity) - geo_chart_vector(end.point, end.velocity));
    }
    return segment;
}

// A path of no length, in state g.
Path walk_start(Geodesic g, uint cell, uint label) {
    return Path(g.point, g.velocity, 0.0, 0.0, IO_END_LIMIT, cell, 0u, 0u, label, PATH_FLYING);
}

Geodesic walk_state(Path path) {
    return Geodesic(path.point, path.velocity);
}

// The state at curve parameter u of the segment that is traced.
Geodesic walk_along(Path path, float u) {
    return geo_advance(walk_state(path), GEO_STRAIGHT ? u : u - path.u_end);
}

void walk_set(inout Path path, Geodesic g) {
    path.point = g.point;
    path.velocity = g.velocity;
}

// Geodesic length at which primary rays end.
float walk_limit() {
    return IO_MAX_DISTANCE ? io_view[0].max_distance : M_INFINITY;
}

uint walk_cell(Path path) {
    return IO_FACES == 0u ? path.cell : 0u;
}

// Notes that the path has passed a face.
void walk_passed(inout Path path, uint face) {
#ifdef WALK_CROSSED
    // An entry that wants to know the faces.
    WALK_CROSSED(path.bounces, face);
#endif
    path.bounces++;
    if (IO_FACES == 0u) path.cell = io_faces[face].cell;
    if (IO_LABELS && path.label != IO_NONE) path.label = io_label_table[path.label * uint(io_faces.length()) + face];
}

// The state g in the coordinates of the cell beyond a face.
Geodesic walk_beyond(Geodesic g, uint face) {
    return geo_cross(Isometry(io_faces[face].linear, io_faces[face].shift), io_faces[face].plane, g);
}

// Takes the path, in state g, through a face.
void walk_cross(inout Path path, Geodesic g, uint face) {
    Geodesic beyond;
#ifdef WALK_TOGETHER
    // Those of a subgroup that pass the same face go together, so that its numbers are read once for all of them.
    for (bool waiting = IO_TOGETHER > 0u; waiting;) {
        uint first = subgroupBroadcastFirst(face);
        if (first == face) {
            beyond = walk_beyond(g, first);
            waiting = false;
        }
    }
    if (IO_TOGETHER == 0u)
#endif
        beyond = walk_beyond(g, face);
    walk_set(path, geo_restore(beyond));
    walk_passed(path, face);
}

// Largest deviation of the next arc from its curve, a length, for a tolerance that is an angle e seen from the source:
// e times the distance, and at the source what an arc whose direction is off by e deviates (deviation_at in
// src/space/walk.rs).
float walk_tolerance(Path path) {
    float angle = io_view[0].tolerance;
    return angle * (path.travelled + sqrt(angle) / 3.0);
}

// How far the next segment reaches: curve parameter of its end and what is there. An arc is known before any face is
// looked at, and shows which faces it may leave by at all.
struct Reach {
    float u;
    uint end;
    Geodesic state; // at the end
    Segment segment;
};

Reach walk_reach(Path path, float limit) {
    Geodesic g = walk_state(path);
    float rest = isinf(limit) ? M_INFINITY : geo_parameter_at(g, limit - path.travelled);
    float arc = geo_arc(g, rest, walk_tolerance(path));
    Reach reach = Reach(arc, arc < rest ? IO_END_ARC : IO_END_LIMIT, g, Segment(vec3(0.0), vec3(0.0), vec3(0.0)));
    if (GEO_STRAIGHT) return reach;
    float stride = geo_parameter_at(g, IO_STRIDE);
    if (stride < arc) {
        reach.u = stride;
        reach.end = IO_END_ARC;
    }
    reach.state = geo_advance(g, reach.u);
    reach.segment = segment_between(g, reach.state, reach.u);
    return reach;
}

// What the faces say of a state: where the geodesic leaves, and which face it violates most.
struct Faces {
    float u;
    uint exit;
    float worst;
    uint violated;
};

// Notes how far the state is beyond a face. Whether the segment comes near it: most faces are far from an arc.
bool walk_test_side(Geodesic g, uint face, vec4 plane, Segment segment, float margin, inout Faces faces) {
    float side = geo_side(g.point, plane);
    if (side > faces.worst) {
        faces.worst = side;
        faces.violated = face;
    }
    return GEO_STRAIGHT || segment_highest(segment, plane) >= -margin;
}

// Notes where the geodesic leaves by a face. Exits beyond faces.u do not matter.
void walk_test_exit(Geodesic g, uint face, vec4 plane, inout Faces faces) {
    float u = geo_exit(g, plane, faces.u);
    if (u < faces.u) {
        faces.u = u;
        faces.exit = face;
    }
}

void walk_test_face(Geodesic g, uint face, vec4 plane, Segment segment, float margin, inout Faces faces) {
    if (walk_test_side(g, face, plane, segment, margin, faces)) walk_test_exit(g, face, plane, faces);
}

// The faces that an invocation goes through in a loop, a bit for each: those it is near. Invocations that go together take those
// of all of them, so that the numbers of a face are read once.
uint walk_near_faces(uint near) {
#ifdef WALK_TOGETHER
    if (IO_TOGETHER > 0u) return subgroupOr(near);
#endif
    return near;
}

// Tests the faces of the only cell: a known number, in a known place. Exits from arcs are dear, and most arcs are near no face:
// they are looked for only by the faces that an arc is near, one after the other.
void walk_test_only_cell(Geodesic g, Segment segment, float margin, inout Faces faces) {
    uint near = 0u;
    [[unroll]] for (uint face = 0u; face < IO_FACES; face++) {
        if (GEO_STRAIGHT) walk_test_face(g, face, io_planes[face], segment, margin, faces);
        else if (walk_test_side(g, face, io_planes[face], segment, margin, faces)) near |= 1u << face;
    }
    if (GEO_STRAIGHT) return;
    for (uint left = walk_near_faces(near); left != 0u; left &= left - 1u) {
        uint face = uint(findLSB(left));
        if (((near >> face) & 1u) != 0u) walk_test_exit(g, face, io_faces[face].plane, faces);
    }
}

Faces walk_test_faces(Path path, Reach reach) {
    Geodesic g = walk_state(path);
    float margin = IO_FACE_MARGIN * walk_tolerance(path) + IO_ON_FACE;
    Faces faces = Faces(reach.u, reach.end, IO_ON_FACE, IO_END_LIMIT);
    if (IO_FACES > 0u) {
        walk_test_only_cell(g, reach.segment, margin, faces);
    } else {
        uint first = io_cells[path.cell].first_face;
        uint end = first + io_cells[path.cell].face_count;
        for (uint face = first; face < end; face++) {
            walk_test_face(g, face, io_faces[face].plane, reach.segment, margin, faces);
        }
    }
    return faces;
}

// The same parabola, a little beyond its ends.
Segment segment_extended(Segment segment, bool first) {
    float slack = IO_OVERLAP * inversesqrt(max(dot(segment.direction, segment.direction), 1e-12));
    if (GEO_STRAIGHT) {
        if (!first) segment.origin -= slack * segment.direction;
        segment.direction *= first ? 1.0 + slack : 1.0 + 2.0 * slack;
        return segment;
    }
    vec3 end = segment_at(segment, 1.0 + slack);
    if (!first) segment.origin = segment_at(segment, -slack);
    float whole = first ? 1.0 + slack : 1.0 + 2.0 * slack;
    return Segment(segment.origin, end - segment.origin, segment.bend * whole * whole);
}

#include "stage/stepped.glsl"

// Brings a state that rounding has left outside of its cell (at an edge or a corner) back. False: the path has ended.
bool walk_reduce(inout Path path, float limit, uint bounces, inout Reach reach, inout Faces faces) {
    uint attempt = 0u;
    do {
        bool lost = attempt++ == IO_REDUCE_LIMIT;
        if (lost) count(IO_COUNT_LOST);
        if (lost || path.bounces == bounces) {
            path.status = PATH_GONE;
            return false;
        }
        walk_cross(path, walk_state(path), faces.violated);
        reach = walk_reach(path, limit);
        faces = walk_test_faces(path, reach);
    } while (faces.violated != IO_END_LIMIT);
    return true;
}

// Finds the end of the segment that starts at the path's state. The path ends after geodesic length `limit`, and at most
// `bounces` faces are passed. False: the path has ended.
bool stage_segment(inout Path path, float limit, uint bounces, bool first, out Segment segment) {
    if (IO_INTEGRATOR != IO_INTEGRATOR_EXACT) return stepped_segment(path, limit, bounces, first, segment);
    Reach reach = walk_reach(path, limit);
    Faces faces = walk_test_faces(path, reach);
    // Asked before the loop: software that runs invocations in lockstep enters a loop even if none of them does.
    if (faces.violated != IO_END_LIMIT && !walk_reduce(path, limit, bounces, reach, faces)) return false;
    float u = faces.u;
    path.end = faces.exit;
    Geodesic g = walk_state(path);
    // A geodesic that meets no face and has no limit ends here: only an unbounded cell lets it. One with a limit that
    // the curve parameter does not reach goes there in strides.
    if (GEO_STRAIGHT && isinf(u)) {
        if (isinf(limit)) {
            path.status = PATH_GONE;
            return false;
        }
        u = geo_parameter_at(g, IO_STRIDE);
        path.end = IO_END_ARC;
    }
    if (GEO_STRAIGHT || u < reach.u) {
        reach.state = geo_advance(g, u);
        reach.segment = segment_between(g, reach.state, u);
    }
    if (!GEO_STRAIGHT) walk_set(path, reach.state);
    path.u_end = u;
    path.segments++;
    segment = segment_extended(reach.segment, first);
    return true;
}

// Transport: the segment met nothing, so the geodesic moves on to its end and through the face there. Its length is
// only summed up if it is `measured`.
void stage_transport(inout Path path, uint bounces, bool measured) {
    if (IO_INTEGRATOR != IO_INTEGRATOR_EXACT) {
        stepped_transport(path, bounces);
        return;
    }
    Geodesic g = GEO_STRAIGHT ? geo_advance(walk_state(path), path.u_end) : walk_state(path);
    if (measured) path.travelled += geo_length(walk_state(path), path.u_end);
    if (path.end == IO_END_ARC) {
        walk_set(path, geo_restore(g));
    } else if (path.end == IO_END_LIMIT || path.bounces == bounces) {
        walk_set(path, g);
        path.status = PATH_GONE;
    } else {
        walk_cross(path, g, path.end);
    }
}

// The miss stage of a pixel's ray or of a shadow ray.
void stage_miss(inout Path path, bool shadow) {
    stage_transport(path, shadow ? IO_SHADOW_BOUNCES : io_view[0].bounces, IO_LENGTHS || shadow);
}

#endif
