// The recursive variant, an experiment: as in the book's text (its section 3.3.5) the miss shader does not only
// transport the geodesic but traces on itself. Each segment is one level of recursion, up to one more than bounces, which
// is what the pipeline declares; arcs beyond that are left to raygen's loop.
#define COUNT_AT_ONCE
#include "trace/payload.glsl"

layout(location = PAYLOAD) rayPayloadInEXT Payload payload;
#include "trace/pieces.glsl"

void main() {
    stage_miss(payload.path, false);
    Segment segment;
    if (payload.path.status != PATH_FLYING || payload.path.segments > io_view[0].bounces
        || !stage_segment(payload.path, walk_limit(), io_view[0].bounces, false, segment)) return;
    count(IO_COUNT_SEGMENTS);
    pieces_trace(segment, io_cells[walk_cell(payload.path)].scene, IO_KIND_ALL, false);
}
