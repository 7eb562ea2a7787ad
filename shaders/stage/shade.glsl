// Riemannian shading: Lambert and specular light by the metric at the hit, falloff by the area density of the
// geometry, shadows along geodesics through the faces. Called by the ray generation stage once a path has hit,
// so that shadow rays are traced from there and no stage ever traces from inside another.
#ifndef SHADE_GLSL
#define SHADE_GLSL
#include "stage/walk.glsl"
#include "stage/surface.glsl"
#include "shared/brdf.glsl"

// Whether something stands between a surface point and a light at distance `range` in direction of g.
bool shade_occluded(Geodesic g, float range, uint cell) {
    count(IO_COUNT_SHADOW_RAYS);
    Path path = walk_start(g, cell, IO_NONE);
    Segment segment;
    bool first = true;
    while (path.status == PATH_FLYING && stage_segment(path, range, IO_SHADOW_BOUNCES, first, segment)) {
        count(IO_COUNT_SHADOW_SEGMENTS);
        trace_shadow_segment(path, segment);
        first = false;
    }
    return path.status == PATH_HIT;
}

// Light of one image of a point light.
vec3 shade_light(uint index, Path path, Surface surface, float nv) {
    // Most images are out of range: they are told before anything is computed.
    if (geo_closeness(path.point, io_light_images[index].point) < io_light_images[index].closest) return vec3(0.0);
    Light light = io_light_images[index];
    float range;
    vec4 direction = geo_log(path.point, light.point, range);
    float nl = geo_inner(path.point, surface.normal, direction);
    if (range >= light.range || nl <= 0.0) return vec3(0.0);
    if (light.spot_cosine >= -1.0) {
        float unused;
        vec4 outward = geo_log(light.point, path.point, unused);
        if (geo_inner(light.point, light.axis, outward) < light.spot_cosine) return vec3(0.0);
    }
    if (IO_SHADOWS && light.shadows != 0u) {
        // From a point a little above the surface, so that it does not shadow itself.
        Geodesic above = geo_flow(Geodesic(path.point, surface.normal), IO_SHADOW_OFFSET);
        float to_light;
        vec4 towards = geo_log(above.point, light.point, to_light);
        // And to a point a little before the light: what it is fixed to does not hide it from one side at random.
        float reach = to_light - IO_SHADOW_OFFSET;
        if (reach > 0.0 && shade_occluded(Geodesic(above.point, towards), reach, path.cell)) return vec3(0.0);
    }
    float share = range / light.range;
    float window = 1.0 - share * share * share * share;
    float area = max(geo_area_density(Geodesic(path.point, direction), range), IO_MIN_LIGHT_AREA);
    float lv = -geo_inner(path.point, path.velocity, direction);
    return light.color * (window * window / area) * brdf(surface.base_color, surface.metallic, surface.roughness, nl, nv, lv);
}

// Linear colour of the path's hit.
vec3 stage_shade(Path path, Surface surface) {
    float nv = -geo_inner(path.point, path.velocity, surface.normal);
    vec3 color = surface.emission + io_view[0].ambient * surface.base_color;
    if (IO_HEADLIGHT && nv > 0.0) {
        // The ray itself is the geodesic to the viewer's light: nothing can stand in between.
        float area = max(geo_area_density(Geodesic(path.point, -path.velocity), path.travelled), IO_MIN_LIGHT_AREA);
        color += io_view[0].headlight / area * brdf(surface.base_color, surface.metallic, surface.roughness, nv, nv, 1.0);
    }
    if (IO_LIGHTS) {
        uint first = io_cells[walk_cell(path)].first_light;
        uint number = io_cells[walk_cell(path)].light_count;
        for (uint i = 0u; i < number; i++) {
            color += shade_light(first + i, path, surface, nv);
        }
    }
    if (IO_FOG) color = mix(io_view[0].background, color, exp(-io_view[0].fog * path.travelled));
    return color;
}

#endif
