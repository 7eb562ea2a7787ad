// Riemannian shading: Lambert and specular light by the metric at the hit, falloff by the area density of the
// geometry, shadows along geodesics through the faces. The ray generation stage traces the rays to the lights, so that no
// stage ever traces from inside another.
#ifndef SHADE_GLSL
#define SHADE_GLSL
#include "stage/walk.glsl"
#include "stage/surface.glsl"
#include "shared/brdf.glsl"

// What is seen where a path ends, and which images of lights still have to be asked whether something hides them.
struct Shading {
    Surface surface;
    float nv;      // normal with viewer
    vec3 color;    // linear, of the light that has arrived so far
    uint next;     // image to look at next: its place in the lists
    uint end;      // after the last one
    uint asked;    // bit i: the image listed at next - 32 + i shines on the surface, unless something hides it
    uint light;    // image that the ray in flight goes to
};

// Of a path that has met nothing.
Shading shade_nothing() {
    Surface none = Surface(vec4(0.0), vec3(0.0), vec3(0.0), 0.0, 0.0);
    return Shading(none, 0.0, io_view[0].background, 0u, 0u, 0u, 0u);
}

// Where the images that may shine on a point of a cell are listed: the first place, and the one after the last.
uvec2 shade_list(uint cell, vec4 point) {
    if (!IO_LIGHTS) return uvec2(0u);
    uint boxes = io_cells[cell].light_boxes;
    vec3 place = (geo_chart(point) - io_cells[cell].light_lower) * io_cells[cell].light_scale;
    // Boxes at the sides reach out without end.
    uvec3 at = min(uvec3(max(place, vec3(0.0))), uvec3(boxes - 1u));
    uint start = io_cells[cell].light_lists + (at.z * boxes + at.y) * boxes + at.x;
    return uvec2(io_light_lists[start], io_light_lists[start + 1u]);
}

// Of the path's hit, with the light that nothing can hide.
Shading shade_start(Path path, Hit hit) {
    Surface surface = surface_at(path, hit);
    float nv = -geo_inner(path.point, path.velocity, surface.normal);
    vec3 color = surface.emission + io_view[0].ambient * surface.base_color;
    if (IO_HEADLIGHT && nv > 0.0) {
        // The ray itself is the geodesic to the viewer's light: nothing can stand in between.
        float area = max(geo_area_density(Geodesic(path.point, -path.velocity), path.travelled), IO_MIN_LIGHT_AREA);
        color += io_view[0].headlight / area * brdf(surface.base_color, surface.metallic, surface.roughness, nv, nv, 1.0);
    }
    uvec2 list = shade_list(walk_cell(path), path.point);
    return Shading(surface, nv, color, list.x, list.y, 0u, 0u);
}

// Whether an image of a light shines on the surface, unless something hides it.
bool shade_shines(uint image, Path path, vec4 normal) {
    // Images of the same box that are out of range are told before anything is computed.
    if (geo_closeness(path.point, io_light_images[image].point) < io_light_images[image].closest) return false;
    Light light = io_light_images[image];
    float range;
    vec4 direction = geo_log(path.point, light.point, range);
    if (range >= light.range || geo_inner(path.point, normal, direction) <= 0.0) return false;
    if (light.spot_cosine < -1.0) return true;
    float unused;
    vec4 outward = geo_log(light.point, path.point, unused);
    return geo_inner(light.point, light.axis, outward) >= light.spot_cosine;
}

// Adds the light of an image that shines on the surface.
void shade_add(inout Shading shading, Path path, uint image) {
    Light light = io_light_images[image];
    Surface surface = shading.surface;
    float range;
    vec4 direction = geo_log(path.point, light.point, range);
    float nl = geo_inner(path.point, surface.normal, direction);
    float lv = -geo_inner(path.point, path.velocity, direction);
    float share = range / light.range;
    float window = 1.0 - share * share * share * share;
    float area = max(geo_area_density(Geodesic(path.point, direction), range), IO_MIN_LIGHT_AREA);
    shading.color += light.color * (window * window / area)
        * brdf(surface.base_color, surface.metallic, surface.roughness, nl, shading.nv, lv);
}

// Looks at the next images: adds the light of those without shadows, and notes which others have to be asked. False: there
// are no more images.
bool shade_batch(inout Shading shading, Path path) {
    if (!IO_LIGHTS || shading.next >= shading.end) return false;
    uint number = min(shading.end - shading.next, 32u);
    for (uint i = 0u; i < number; i++) {
        uint image = io_light_lists[shading.next + i];
        if (shade_shines(image, path, shading.surface.normal)) {
            if (IO_SHADOWS && io_light_images[image].shadows != 0u) shading.asked |= 1u << i;
            else shade_add(shading, path, image);
        }
    }
    shading.next += 32u;
    return true;
}

// A ray to the next image of the batch that has to be asked, and its largest length. False: none is left.
bool shade_ask(inout Shading shading, Path path, inout Path ray, inout float limit) {
    if (shading.asked == 0u) return false;
    shading.light = io_light_lists[shading.next - 32u + uint(findLSB(shading.asked))];
    shading.asked &= shading.asked - 1u;
    // From a point a little above the surface, so that it does not shadow itself.
    Geodesic above = geo_flow(Geodesic(path.point, shading.surface.normal), IO_SHADOW_OFFSET);
    float to_light;
    above.velocity = geo_log(above.point, io_light_images[shading.light].point, to_light);
    // And to a point a little before the light: what it is fixed to does not hide it from one side at random.
    limit = to_light - IO_SHADOW_OFFSET;
    ray = walk_start(above, path.cell, IO_NONE);
    if (limit > 0.0) count(IO_COUNT_SHADOW_RAYS); else ray.status = PATH_GONE;
    return true;
}

// What the picture shows of a path, once all light has arrived.
vec3 shade_end(Shading shading, Path path) {
    if (!IO_FOG || path.status != PATH_HIT) return shading.color;
    return mix(io_view[0].background, shading.color, exp(-io_view[0].fog * path.travelled));
}

#endif
