// The two types of the geometry contract.
#ifndef TYPES_GLSL
#define TYPES_GLSL

// A point and a tangent vector there; a unit vector unless said otherwise.
struct Geodesic {
    vec4 point;
    vec4 velocity;
};

// An isometry; what the numbers mean is the geometry's own business.
struct Isometry {
    mat4 linear;
    vec4 shift;
};

#endif
