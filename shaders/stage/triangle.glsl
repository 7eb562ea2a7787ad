// Where a segment meets a triangle. Traversal and the closest-hit stage call the same functions, so that every
// backend computes the same hit from the same primitive.
#ifndef TRIANGLE_GLSL
#define TRIANGLE_GLSL
#include "stage/walk.glsl"

const float NO_HIT = 2.0;

// The second triangle of a pair, beyond the edge from b to c.
Triangle pair_second(Triangle pair) {
    return Triangle(pair.c, 0.0, pair.b, 0.0, vec3(pair.after_a, pair.after_b, pair.after_c), 0.0);
}

bool pair_has_second(Triangle pair) {
    return pair.after_a != pair.c.x || pair.after_b != pair.c.y || pair.after_c != pair.c.z;
}

// a x b, which is -(b x a) to the last bit: hardware that contracts one of the two products into an addition would round
// it otherwise than the other, also in its own cross().
vec3 triangle_cross(vec3 a, vec3 b) {
    precise vec3 plus = a.yzx * b.zxy;
    precise vec3 minus = a.zxy * b.yzx;
    precise vec3 difference = plus - minus;
    return difference;
}

// Products of the segment with the edges: of one sign where it passes inside. They are antisymmetric to the last
// bit, so two triangles that share an edge leave no gap: one of them contains every segment that passes it.
vec3 triangle_edges(Segment segment, vec3 a, vec3 b, vec3 c) {
    precise float wa = dot(segment.direction, triangle_cross(b, c));
    precise float wb = dot(segment.direction, triangle_cross(c, a));
    precise float wc = dot(segment.direction, triangle_cross(a, b));
    return vec3(wa, wb, wc);
}

// (s, weight of b, weight of c) on the triangle's plane, whether the segment passes inside or, by the rounding of
// somebody else's test, just beside; s = NO_HIT for a segment along the plane. For straight segments.
vec3 triangle_solve(Segment segment, Triangle triangle) {
    precise vec3 a = triangle.a - segment.origin;
    precise vec3 b = triangle.b - segment.origin;
    precise vec3 c = triangle.c - segment.origin;
    vec3 edges = triangle_edges(segment, a, b, c);
    float sum = edges.x + edges.y + edges.z;
    vec3 normal = cross(b - a, c - a);
    float rate = dot(normal, segment.direction);
    if (sum == 0.0 || rate == 0.0) return vec3(NO_HIT, 0.0, 0.0);
    return vec3(dot(normal, a) / rate, edges.y / sum, edges.z / sum);
}

// Whether a point is on the inner side of an edge, from its distance times the lengths of edge and normal.
bool triangle_within(float weight, vec3 edge, float area, float slack) {
    return weight >= 0.0 || weight >= -slack * sqrt(area * dot(edge, edge));
}

// (s, weight of b, weight of c) of the arc's point at s, which is in the triangle's plane, or NO_HIT outside of the triangle.
vec3 triangle_hit_at(Segment segment, Triangle triangle, float s) {
    if (!(s >= 0.0 && s <= 1.0)) return vec3(NO_HIT);
    precise vec3 b = triangle.b - triangle.a;
    precise vec3 c = triangle.c - triangle.a;
    precise vec3 at = segment_at(segment, s) - triangle.a;
    vec3 normal = cross(b, c);
    float area = dot(normal, normal);
    float wb = dot(normal, cross(at, c));
    float wc = dot(normal, cross(b, at));
    vec3 size = abs(at) + abs(triangle.a) + abs(segment.origin);
    float slack = IO_ON_EDGE * max(size.x, max(size.y, size.z));
    bool inside = triangle_within(wb, c, area, slack) && triangle_within(wc, b, area, slack)
        && triangle_within(area - wb - wc, c - b, area, slack);
    return inside ? vec3(s, wb / area, wc / area) : vec3(NO_HIT);
}

// The same at the first point where an arc meets the triangle: its height over the plane is a quadratic of s.
vec3 triangle_hit_arc(Segment segment, Triangle triangle) {
    precise vec3 b = triangle.b - triangle.a;
    precise vec3 c = triangle.c - triangle.a;
    vec3 normal = cross(b, c);
    // height + (rate + bend) s - bend s^2
    float height = dot(normal, segment.origin - triangle.a);
    float bend = dot(normal, segment.bend);
    float linear = dot(normal, segment.direction) + bend;
    float discriminant = linear * linear + 4.0 * bend * height;
    if (discriminant < 0.0 || dot(normal, normal) == 0.0) return vec3(NO_HIT);
    float q = 0.5 * (linear + (linear < 0.0 ? -1.0 : 1.0) * sqrt(discriminant));
    float one = q == 0.0 ? NO_HIT : -height / q;
    float other = bend == 0.0 ? NO_HIT : q / bend;
    vec3 first = triangle_hit_at(segment, triangle, min(one, other));
    return first.x != NO_HIT ? first : triangle_hit_at(segment, triangle, max(one, other));
}

// The solution for a segment with these products of edges, or NO_HIT where it does not pass inside or ends before.
vec3 triangle_hit_chord(Segment segment, Triangle triangle, vec3 edges) {
    if (min(edges.x, min(edges.y, edges.z)) < 0.0 && max(edges.x, max(edges.y, edges.z)) > 0.0) return vec3(NO_HIT);
    vec3 hit = triangle_solve(segment, triangle);
    return hit.x >= 0.0 && hit.x <= 1.0 ? hit : vec3(NO_HIT);
}

// Where a segment meets both triangles of a pair. Straight ones ask the common edge once.
void pair_hits(Segment segment, Triangle pair, out vec3 first, out vec3 second) {
    Triangle other = pair_second(pair);
    if (!GEO_STRAIGHT) {
        first = triangle_hit_arc(segment, pair);
        second = vec3(NO_HIT);
        if (pair_has_second(pair)) second = triangle_hit_arc(segment, other);
        return;
    }
    precise vec3 a = pair.a - segment.origin;
    precise vec3 b = pair.b - segment.origin;
    precise vec3 c = pair.c - segment.origin;
    precise vec3 d = other.c - segment.origin;
    vec3 edges = triangle_edges(segment, a, b, c);
    precise float wc = dot(segment.direction, triangle_cross(b, d));
    precise float wb = dot(segment.direction, triangle_cross(d, c));
    first = triangle_hit_chord(segment, pair, edges);
    second = triangle_hit_chord(segment, other, vec3(wc, wb, -edges.x));
}

// Weights of the second and third corner of a point of the triangle's plane, clamped to the triangle.
vec2 triangle_weights(Triangle triangle, vec3 at) {
    vec3 b = triangle.b - triangle.a;
    vec3 c = triangle.c - triangle.a;
    vec3 normal = cross(b, c);
    float area = dot(normal, normal);
    if (area == 0.0) return vec2(0.0);
    float wb = clamp(dot(normal, cross(at - triangle.a, c)) / area, 0.0, 1.0);
    float wc = clamp(dot(normal, cross(b, at - triangle.a)) / area, 0.0, 1.0 - wb);
    return vec2(wb, wc);
}

#endif
