// The ray generation stage: a pixel's geodesic, the loop of its segments and of those to the lights, and what the picture
// shows of its end.
//
// The loop replaces recursion: trace_segment comes back after closest-hit or miss with the path's new state.
#ifndef RAYGEN_GLSL
#define RAYGEN_GLSL
#include "stage/walk.glsl"
#include "stage/hit.glsl"
#include "stage/surface.glsl"
#include "stage/shade.glsl"

// The geodesic through a point of the picture, from the tangents of the eye's (asymmetric) frustum.
Geodesic raygen_geodesic(View view, vec2 at) {
    float x = mix(view.tangents.x, view.tangents.y, at.x / float(view.size.x));
    float y = mix(view.tangents.w, view.tangents.z, at.y / float(view.size.y));
    vec4 direction = (view.forward + x * view.right + y * view.up) * inversesqrt(1.0 + x * x + y * y);
    return Geodesic(view.eye, direction);
}

// What the picture shows besides colours: a raw value in all three channels.
vec3 raygen_raw(Path path, Hit hit) {
    bool found = path.status == PATH_HIT;
    if (IO_SHADING == IO_SHADING_NORMALS) return found ? 0.5 + 0.5 * normalize(hit.conormal) : vec3(0.0);
    if (IO_SHADING == IO_SHADING_DISTANCE) return vec3(found ? path.travelled : M_INFINITY);
    if (IO_SHADING == IO_SHADING_BOUNCES) return vec3(path.bounces);
    if (IO_SHADING == IO_SHADING_SEGMENTS) return vec3(path.segments);
    if (IO_SHADING == IO_SHADING_CELL) return vec3(path.label == IO_NONE ? -1.0 : float(path.label));
    return vec3(found ? float(hit.object) : -1.0);
}

// Column, row and eye of a listed ray.
uvec3 raygen_listed(uint index) {
    uint ray = io_rays[index];
    const uint mask = (1u << IO_LIST_BITS) - 1u;
    return uvec3(ray & mask, (ray >> IO_LIST_BITS) & mask, ray >> (2u * IO_LIST_BITS));
}

// Whether a pixel's ray has met something or is not worth following any further.
bool raygen_ended(View view, Path ray) {
    return ray.status != PATH_FLYING || ray.segments >= (view.bounces + 1u) * IO_SEGMENTS_PER_BOUNCE
        || IO_FOG && view.fog * ray.travelled > IO_FOG_HIDES;
}

void stage_raygen(uvec2 pixel, uint eye, vec2 offset) {
#ifdef RAYGEN_CLOCK
    uint started = clock2x32ARB().x;
#endif
    View view = io_view[eye];
    Geodesic g = raygen_geodesic(view, vec2(pixel) + offset);
    Path path = walk_start(g, view.cell, 0u);
    Hit hit = Hit(vec3(0.0), vec2(0.0), 0u, IO_NONE);
    Shading shading = shade_nothing();
    count(IO_COUNT_RAYS);
    // The ray in flight: the pixel's, then those to lights, by one piece of code. Each invocation asks its own lights one after
    // the other: where they run in lockstep, rays to different lights are traced at the same time.
    Path ray = path;
    float limit = walk_limit();
    bool first = true;
    for (bool shadow = false;; shadow = true) {
        if (shadow && !shade_batch(shading, path)) break;
        while (true) {
            if (shadow && ray.status != PATH_FLYING) {
                if (ray.status == PATH_GONE) shade_add(shading, path, shading.light);
                if (!shade_ask(shading, path, ray, limit)) break;
                first = true;
            } else if (!shadow && raygen_ended(view, ray)) {
                break;
            }
            Segment segment;
            uint bounces = shadow ? IO_SHADOW_BOUNCES : view.bounces;
            if (ray.status == PATH_FLYING && stage_segment(ray, limit, bounces, first, segment)) {
                count(shadow ? IO_COUNT_SHADOW_SEGMENTS : IO_COUNT_SEGMENTS);
                trace_segment(ray, hit, segment, shadow);
                first = false;
            }
        }
        if (!shadow) {
            path = ray;
            if (IO_SHADING != IO_SHADING_RIEMANNIAN || path.status != PATH_HIT) break;
            shading = shade_start(path, hit);
        }
        // None is in flight to a light that could be added.
        ray.status = PATH_HIT;
    }
    if (path.status == PATH_HIT) count(IO_COUNT_HITS);
    count_add(IO_COUNT_BOUNCES, path.bounces);
    uint at = (eye * view.size.y + pixel.y) * view.size.x + pixel.x;
    vec3 result = IO_SHADING == IO_SHADING_RIEMANNIAN ? shade_end(shading, path) : raygen_raw(path, hit);
    // What is seen goes along with what it cost, so that the compiler leaves nothing out.
#ifdef RAYGEN_CLOCK
    result = vec3(float(clock2x32ARB().x - started), result.x + result.y + result.z, 0.0);
#else
    if (IO_HEAT != 0u) result = vec3(float(count_heat), result.x + result.y + result.z, 0.0);
#endif
    // A pixel that has its ray is told by a distance above 0.
    if (IO_EYES) io_pixels[at] = vec4(result, path.status == PATH_HIT ? path.travelled + 1e-6 : M_INFINITY);
    else io_pixels[at] += vec4(result, 1.0);
}

#endif
