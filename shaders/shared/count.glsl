// Work counters, only where the plan counts: private sums, flushed once by entry points that run a whole path. Stages
// that the ray tracing pipeline calls in between (COUNT_AT_ONCE) have no end of their own and add at once.
#ifndef COUNT_GLSL
#define COUNT_GLSL
#include "shared/io.glsl"

#ifdef COUNT_AT_ONCE
void count(uint what) {
    if (IO_COUNTERS) atomicAdd(io_counts[what], 1u);
}
#else
uint count_sums[IO_COUNT_END] = uint[](0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u);

void count(uint what) {
    if (IO_COUNTERS) count_sums[what]++;
}

void count_flush() {
    if (!IO_COUNTERS) return;
    for (uint i = 0u; i < IO_COUNT_END; i++) {
        if (count_sums[i] > 0u) atomicAdd(io_counts[i], count_sums[i]);
    }
}
#endif

#endif
