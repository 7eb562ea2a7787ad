// Rays that meet nothing, each walked through the faces by the stages of the picture: for `holonomy stability`.
#include "shared/io.glsl"

uint walk_index;
uint walk_first;

// The faces that a ray passes, as far as there is room for them.
void walk_record(uint number, uint face) {
    uint room = uint(io_passages.length()) / uint(io_walks.length());
    uint at = number - walk_first;
    if (at < room) io_passages[walk_index * room + at] = face;
}
#define WALK_CROSSED walk_record
#include "stage/walk.glsl"

layout(local_size_x = IO_PROBE_GROUP) in;

void main() {
    walk_index = gl_GlobalInvocationID.x;
    if (walk_index >= uint(io_walks.length())) return;
    Walk walk = io_walks[walk_index];
    walk_first = walk.bounces;
    Path path = walk_start(Geodesic(walk.point, walk.velocity), walk.cell, walk.label);
    path.travelled = walk.travelled;
    path.bounces = walk.bounces;
    path.segments = walk.segments;
    uint most = walk.segments + (walk.until - walk.bounces + 1u) * IO_SEGMENTS_PER_BOUNCE;
    Segment segment;
    while (path.status == PATH_FLYING && path.bounces < walk.until && path.segments < most) {
        if (stage_segment(path, M_INFINITY, IO_NONE, false, segment)) stage_transport(path, IO_NONE, true);
    }
    walk.point = path.point;
    walk.velocity = path.velocity;
    walk.travelled = path.travelled;
    walk.cell = path.cell;
    walk.bounces = path.bounces;
    walk.segments = path.segments;
    walk.label = path.label;
    walk.lost = path.status == PATH_FLYING ? 0u : 1u;
    io_walks[walk_index] = walk;
}
