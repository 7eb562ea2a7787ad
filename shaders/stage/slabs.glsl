// Segments against boxes with sides along the axes.
#ifndef SLABS_GLSL
#define SLABS_GLSL
#include "stage/walk.glsl"

// A segment in coordinates (chart - lower corner) * scale: it passes x along an axis at s = x reciprocal + lower, where a box
// begins, and + upper, where one ends. An arc lies between its chord and the chord shifted by a quarter of the bend, so a box
// that is as much larger to the other side is entered by the chord no later than the box is by the arc.
struct Slabs {
    vec3 reciprocal;
    vec3 lower;
    vec3 upper;
    uint down; // one bit for each axis along which the segment goes down
};

Slabs slabs_of(Segment segment, vec3 corner, vec3 scale) {
    vec3 origin = (segment.origin - corner) * scale;
    vec3 bulge = GEO_STRAIGHT ? vec3(0.0) : 0.25 * segment.bend * scale;
    vec3 direction = segment.direction * scale;
    // A zero component would make 0 * inf = NaN at a box face; a tiny one behaves as a parallel ray.
    direction = mix(direction, vec3(1e-20), lessThan(abs(direction), vec3(1e-20)));
    vec3 reciprocal = 1.0 / direction;
    uvec3 down = uvec3(lessThan(direction, vec3(0.0)));
    return Slabs(reciprocal, -reciprocal * (origin + max(bulge, vec3(0.0))), -reciprocal * (origin + min(bulge, vec3(0.0))),
                 down.x | down.y << 1u | down.z << 2u);
}

#endif
