// Places the triangles of a copy of a mesh that moves: the mesh at rest, carried by an isometry into the chart of the
// cell. Affine maps of the chart would not do: in curved spaces vertices move projectively.
#define IO_PLACEMENT
#include "shared/io.glsl"
#include "shared/types.glsl"
#include "shared/math.glsl"
#include "GEOMETRY"

layout(local_size_x = IO_PLACE_GROUP) in;

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= io_placement.count) return;
    Isometry isometry = Isometry(io_placement.linear, io_placement.shift);
    vec3 at[3];
    vec3 conormal[3];
    bool outside = false;
    for (uint i = 0u; i < 3u; i++) {
        RestVertex rest = io_rest[io_placement.first_vertex + io_rest_corners[io_placement.first_corner + 3u * index + i]];
        Geodesic g = geo_apply(isometry, Geodesic(rest.point, rest.normal));
        at[i] = geo_chart(g.point);
        conormal[i] = geo_lower(g.point, g.velocity);
        // Points that have no chart coordinates do not come back from there.
        vec4 back = geo_unchart(at[i]) - g.point;
        outside = outside || !(dot(back, back) < 1e-2 * dot(g.point, g.point) + 1e-2);
    }
    // Triangles that reach out of the chart are far from the cell. They shrink to a point instead of vanishing, because
    // a refit must find as many triangles as the build did.
    if (outside) at[0] = at[1] = at[2] = vec3(0.0);
    uint triangle = io_placement.first_triangle + index;
    io_placed[triangle] = Triangle(at[0], 0.0, at[1], 0.0, at[2], 0.0);
    if (!GEO_STRAIGHT) {
        vec3 lower = min(at[0], min(at[1], at[2]));
        vec3 upper = max(at[0], max(at[1], at[2]));
        io_placed_boxes[triangle] = Box(lower - io_placement.margin - IO_BOX_SLACK * (1.0 + abs(lower)),
                                        upper + io_placement.margin + IO_BOX_SLACK * (1.0 + abs(upper)));
    }
    io_placed_shading[triangle].conormal_a = conormal[0];
    io_placed_shading[triangle].conormal_b = conormal[1];
    io_placed_shading[triangle].conormal_c = conormal[2];
}
