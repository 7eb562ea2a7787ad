// Steps towards the first passage of a curve through a plane, where no closed form says it. Twin and theory:
// src/geometry/passage.rs.
#ifndef PASSAGE_GLSL
#define PASSAGE_GLSL
#include "shared/io.glsl"

// More steps are not made.
const int PASSAGE_STEPS = 64;

// A form that grows at this rate from this value is about to pass, by the rules of geo_exit.
bool passage_arrives(float value, float rate) {
    return value > -IO_ON_FACE && rate > IO_ALONG_FACE;
}

// A step that passes no root, where `bend` bounds the second derivative.
float passage_step(float value, float rate, float bend) {
    float distance = max(abs(value), IO_ON_FACE);
    float bound = max(bend, 1e-30);
    float root = sqrt(rate * rate + 2.0 * bound * distance);
    return rate > 0.0 ? 2.0 * distance / (rate + root) : (root - rate) / bound;
}

#endif
