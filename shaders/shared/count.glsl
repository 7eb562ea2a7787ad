// Work counters: private sums, flushed once per invocation, and only where the plan counts.
#ifndef COUNT_GLSL
#define COUNT_GLSL
#include "shared/io.glsl"

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
