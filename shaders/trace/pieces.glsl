// How the device's traversal, which knows straight rays only, gets a segment. Who includes this has declared the payload.
//
// An arc is traced in pieces, one after the other. Each is an arc of a parabola as well, and nowhere farther than an eighth of
// its own bend from its chord shifted by an eighth of it: that is the ray, and boxes about triangles have as much room around
// them (World::margin). The intersection shader meets the triangles with the arc itself, and says so if it is in this piece.
#ifndef PIECES_GLSL
#define PIECES_GLSL
#include "stage/walk.glsl"

// In how many pieces a segment is traced: the bend of each falls with the square of their number.
uint pieces_of(Segment segment) {
    if (GEO_STRAIGHT) return 1u;
    vec3 size = abs(segment.bend);
    float sagitta = 0.25 * max(size.x, max(size.y, size.z));
    return uint(clamp(ceil(sqrt(sagitta / io_view[0].sagitta)), 1.0, float(IO_PIECES)));
}

// Without masks any-hit shaders need not be looked for.
const uint PIECES_FLAGS = IO_ALPHA_MASK ? gl_RayFlagsNoneEXT : gl_RayFlagsOpaqueEXT;
const uint PIECES_SHADOW_FLAGS = PIECES_FLAGS | gl_RayFlagsTerminateOnFirstHitEXT | gl_RayFlagsSkipClosestHitShaderEXT;

// Traces a segment of a pixel's ray or of a shadow ray in an acceleration structure, among instances of some kinds.
void pieces_trace(Segment segment, uvec2 scene, uint kinds, bool shadow) {
    uint flags = shadow ? PIECES_SHADOW_FLAGS : PIECES_FLAGS;
    uint miss = shadow ? MISS_SHADOW : MISS_PRIMARY;
    uint count = pieces_of(segment);
    float share = 1.0 / float(count);
    for (uint piece = 0u;; piece++) {
        // A shadow ray has hit something unless its miss shader says otherwise.
        if (shadow) payload.path.status = PATH_HIT;
        vec3 origin = segment.origin;
        vec3 direction = segment.direction;
        bool last = true;
        if (!GEO_STRAIGHT) {
            float s = float(piece) * share;
            io_arcs[payload_launch()] = Arc(segment.origin, segment.direction, segment.bend, float(piece), float(count));
            origin = segment_at(segment, s) + 0.125 * share * share * segment.bend;
            direction = share * (segment.direction + (1.0 - 2.0 * s - share) * segment.bend);
            last = piece + 1u == count;
        }
#ifdef RT_REORDER
        // Invocations that will run the same shader are brought together before they run it.
        hitObjectNV found;
        hitObjectTraceRayNV(found, accelerationStructureEXT(scene), flags, kinds, 0u, 1u, last ? miss : MISS_PIECE, origin, 0.0,
                            direction, 1.0, PAYLOAD);
        reorderThreadNV(found);
        hitObjectExecuteShaderNV(found, PAYLOAD);
#else
        traceRayEXT(accelerationStructureEXT(scene), flags, kinds, 0u, 1u, last ? miss : MISS_PIECE, origin, 0.0, direction, 1.0,
                    PAYLOAD);
#endif
        if (last || payload.path.status != PATH_FLYING) break;
    }
}

#endif
