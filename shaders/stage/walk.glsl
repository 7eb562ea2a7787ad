// Walking a geodesic through the cells: segments for traversal, and transport through the faces.
//
// A path alternates between two steps. `stage_segment` finds how far the geodesic goes before it leaves the cell
// (or the chord's tolerance, or its largest length) and gives the straight piece of the chart to traversal; if
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

// State of a ray between two segments; what the ray tracing pipeline carries from stage to stage (64 bytes).
struct Path {
    vec4 point;     // where the current segment starts, in the cell's coordinates
    vec4 velocity;  // unit tangent vector there
    float travelled; // geodesic length from the source to `point`
    float u_end;    // curve parameter of the segment's end
    uint end;       // face at the segment's end (index into all faces), IO_END_CHORD or IO_END_LIMIT
    uint cell;
    uint bounces;   // faces passed
    uint segments;  // segments begun
    uint label;     // deck element of the cell, IO_NONE beyond the table
    uint status;
};

// A straight piece of the chart, s in [0, 1].
struct Segment {
    vec3 origin;
    vec3 direction;
};

// A path of no length, in state g.
Path walk_start(Geodesic g, uint cell, uint label) {
    return Path(g.point, g.velocity, 0.0, 0.0, IO_END_LIMIT, cell, 0u, 0u, label, PATH_FLYING);
}

Geodesic walk_state(Path path) {
    return Geodesic(path.point, path.velocity);
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
    path.bounces++;
    if (IO_FACES == 0u) path.cell = io_faces[face].cell;
    if (IO_LABELS && path.label != IO_NONE) path.label = io_label_table[path.label * uint(io_faces.length()) + face];
}

// Takes the path through a face.
void walk_cross(inout Path path, Geodesic g, uint face) {
    Geodesic h = geo_restore(geo_cross(Isometry(io_faces[face].linear, io_faces[face].shift), io_faces[face].plane, g));
    path.point = h.point;
    path.velocity = h.velocity;
    walk_passed(path, face);
}

// What the faces say of a state: where the geodesic leaves, and which face it violates most.
struct Faces {
    float u;
    uint exit;
    float worst;
    uint violated;
};

void walk_test_face(Geodesic g, uint face, inout Faces faces) {
    vec4 plane = io_faces[face].plane;
    float side = geo_side(g.point, plane);
    if (side > faces.worst) {
        faces.worst = side;
        faces.violated = face;
    }
    float u = geo_exit(g, plane);
    if (u < faces.u) {
        faces.u = u;
        faces.exit = face;
    }
}

Faces walk_test_faces(Path path) {
    Geodesic g = walk_state(path);
    Faces faces = Faces(M_INFINITY, IO_END_LIMIT, IO_ON_FACE, IO_END_LIMIT);
    if (IO_FACES > 0u) {
        // One cell: a loop of known length with reads at known places.
        [[unroll]] for (uint face = 0u; face < IO_FACES; face++) walk_test_face(g, face, faces);
    } else {
        uint first = io_cells[path.cell].first_face;
        uint end = first + io_cells[path.cell].face_count;
        for (uint face = first; face < end; face++) walk_test_face(g, face, faces);
    }
    return faces;
}

// Largest deviation of the next chord from its curve, a length: the tolerance is an angle e seen from the source, so it
// is e times the distance, travelled + s for a point at s along the chord. A curve of curvature k leaves its chord by
// k s (h - s) / 2 there. That stays within the angle up to the h with sqrt(travelled + h) = sqrt(travelled) + sqrt(2 e / k),
// whose deviation k h^2 / 8 is e travelled far from the source and e^2 / 2k at the source. The model geometries have
// curvatures of order 1, and so the sum of both serves at any distance, wherever faces cut the path.
float walk_tolerance(Path path) {
    float angle = io_view[0].chord_tolerance;
    return angle * (path.travelled + 0.5 * angle);
}

#include "stage/stepped.glsl"

// Finds the end of the segment that starts at the path's state, and brings a state that rounding has left outside
// of its cell (at an edge or a corner) back first. The path ends after geodesic length `limit`, and at most `bounces`
// faces are passed. False: the path has ended.
bool stage_segment(inout Path path, float limit, uint bounces, bool first, out Segment segment) {
    if (IO_INTEGRATOR != IO_INTEGRATOR_EXACT) return stepped_segment(path, limit, bounces, first, segment);
    Faces faces = walk_test_faces(path);
    for (uint attempt = 0u; faces.violated != IO_END_LIMIT; attempt++) {
        bool lost = attempt == IO_REDUCE_LIMIT;
        if (lost) count(IO_COUNT_LOST);
        if (lost || path.bounces == bounces) {
            path.status = PATH_GONE;
            return false;
        }
        walk_cross(path, walk_state(path), faces.violated);
        faces = walk_test_faces(path);
    }
    float u = faces.u;
    path.end = faces.exit;
    Geodesic g = walk_state(path);
    float rest = geo_parameter_at(g, limit - path.travelled);
    if (rest < u) {
        u = rest;
        path.end = IO_END_LIMIT;
    }
    // A geodesic that meets no face and has no limit ends here: only an unbounded cell lets it. One with a limit that
    // the curve parameter does not reach goes there in strides.
    if (isinf(u)) {
        if (isinf(limit)) {
            path.status = PATH_GONE;
            return false;
        }
        u = geo_parameter_at(g, IO_STRIDE);
        path.end = IO_END_CHORD;
    }
    float chord = geo_chord(g, u, walk_tolerance(path));
    if (chord < u) {
        u = chord;
        path.end = IO_END_CHORD;
    }
    path.u_end = u;
    path.segments++;
    segment.origin = geo_chart(g.point);
    segment.direction = geo_chart(geo_advance(g, u).point) - segment.origin;
    float slack = IO_OVERLAP * inversesqrt(max(dot(segment.direction, segment.direction), 1e-12));
    if (!first) segment.origin -= slack * segment.direction;
    segment.direction *= first ? 1.0 + slack : 1.0 + 2.0 * slack;
    return true;
}

// The miss stage: the segment met nothing, so the geodesic moves on to its end and through the face there.
void stage_transport(inout Path path, uint bounces) {
    if (IO_INTEGRATOR != IO_INTEGRATOR_EXACT) {
        stepped_transport(path, bounces);
        return;
    }
    Geodesic g = walk_state(path);
    path.travelled += geo_length(g, path.u_end);
    g = geo_advance(g, path.u_end);
    if (path.end == IO_END_CHORD) {
        g = geo_restore(g);
        path.point = g.point;
        path.velocity = g.velocity;
    } else if (path.end == IO_END_LIMIT || path.bounces == bounces) {
        path.point = g.point;
        path.velocity = g.velocity;
        path.status = PATH_GONE;
    } else {
        walk_cross(path, g, path.end);
    }
}

#endif
