// Voxels that say where nothing is in a cell. Twin: src/render/world/voxels.rs.
#ifndef VOXELS_GLSL
#define VOXELS_GLSL
#include "stage/walk.glsl"

// Whether anything may be where a segment of a cell goes: one bit of the level on which it is no longer than a voxel.
bool voxels_near(Segment segment, uint cell) {
    if (GEO_STRAIGHT) return true;
    uint first = io_cells[cell].voxels;
    if (first == IO_NONE) return true;
    vec3 scale = io_cells[cell].grid_scale * (float(IO_VOXELS) / float(IO_LINES));
    vec3 start = (segment.origin - io_cells[cell].grid_lower) * scale;
    vec3 way = segment.direction * scale;
    vec3 bulge = 0.25 * segment.bend * scale;
    vec3 lower = start + min(way, vec3(0.0)) + min(bulge, vec3(0.0));
    vec3 upper = start + max(way, vec3(0.0)) + max(bulge, vec3(0.0));
    if (any(lessThan(upper, vec3(0.0))) || any(greaterThan(lower, vec3(IO_VOXELS)))) return false;
    vec3 size = upper - lower;
    // The binary logarithm, rounded up.
    uint level = uint(max(int((floatBitsToUint(max(size.x, max(size.y, size.z))) + 0x7fffffu) >> 23u) - 127, 0));
    if (level >= IO_VOXEL_LEVELS) return true;
    // Inside of the grid whatever `lower` is.
    uvec3 at = (uvec3(m_whole(floor(clamp(lower, vec3(0.0), vec3(IO_VOXELS - 1u))))) & (IO_VOXELS - 1u)) >> level;
    uint edge = IO_VOXELS >> level;
    uint bit = (at.z * edge + at.y) * edge + at.x;
    // Each level has an eighth of the words of the one before.
    const uint all = IO_VOXELS * IO_VOXELS * IO_VOXELS / 4u;
    uint word = io_voxels[first + (all - (all >> (3u * level))) / 7u + (bit >> 5u)];
    return ((word >> (bit & 31u)) & 1u) != 0u;
}

#endif
