// Work counters, only where the plan counts: private sums, flushed once at the end by entry points that run a whole
// path in one piece. The stages of the ray tracing pipeline (COUNT_AT_ONCE) add at once: their private variables would
// have to be kept alive through every trace.
#ifndef COUNT_GLSL
#define COUNT_GLSL
#include "shared/io.glsl"

// What the pixel shows of its work, where it does: counted where a path begins and ends, so not in hit and miss shaders.
uint count_heat = 0u;

#ifdef COUNT_AT_ONCE
void count_add(uint what, uint number) {
    if (IO_COUNTERS) atomicAdd(io_counts[what], number);
    if (what + 1u == IO_HEAT) count_heat += number;
}
#else
uint count_sums[IO_COUNT_END] = uint[](0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u);

void count_add(uint what, uint number) {
    if (IO_COUNTERS) count_sums[what] += number;
    if (what + 1u == IO_HEAT) count_heat += number;
}

void count_flush() {
    if (!IO_COUNTERS) return;
    for (uint i = 0u; i < IO_COUNT_END; i++) {
        if (count_sums[i] > 0u) atomicAdd(io_counts[i], count_sums[i]);
    }
}
#endif

void count(uint what) {
    count_add(what, 1u);
}

#endif
