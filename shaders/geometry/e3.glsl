// Euclidean space. Twin: src/geometry/e3.rs.
//
// CONTRACT. A file in this folder defines the functions below for one geometry, in f32, under the names of the
// trait Geometry in src/geometry/mod.rs with the prefix geo_ (test: shaders::contract). The build compiles every
// entry point once with each of the files; nothing else in the shaders knows which one it is.
//
//   const bool GEO_STRAIGHT                                 whether all geodesics are straight in the chart
//   vec4     geo_base()                                     the base point
//   float    geo_inner(vec4 p, vec4 u, vec4 v)              the metric at p
//   Geodesic geo_flow(Geodesic g, float t)                  exact flow by arc length t, any sign
//   vec4     geo_log(vec4 p, vec4 q, out float length)      unit velocity and length of the shortest geodesic p -> q
//   float    geo_closeness(vec4 p, vec4 q)                 decreases with the distance, without transcendentals
//   float    geo_area_density(Geodesic g, float t)          wavefront area per solid angle after length t
//   float    geo_length(Geodesic g, float u)                arc length at curve parameter u
//   float    geo_parameter_at(Geodesic g, float t)          curve parameter at arc length t >= 0
//   Geodesic geo_advance(Geodesic g, float u)               state at curve parameter u
//   float    geo_side(vec4 p, vec4 plane)                   size of the plane's form at p: negative inside
//   float    geo_exit(Geodesic g, vec4 plane, float reach)  first u in [0, reach] where g leaves through plane; else more
//   float    geo_arc(Geodesic g, float u_max, float tol)    largest u <= u_max whose arc deviates at most tol
//   float    geo_parameter(Geodesic g, vec3 c)              u of the curve's point nearest to chart point c
//   Geodesic geo_restore(Geodesic g)                        the state, back on the model
//   vec3     geo_chart(vec4 p)                              chart coordinates
//   vec4     geo_unchart(vec3 c)                            and back
//   vec4     geo_unchart_vector(vec4 p, vec3 dc)            the tangent vector at p with this image in the chart
//   vec3     geo_chart_vector(vec4 p, vec4 v)               image of a tangent vector in the chart
//   vec3     geo_spray(vec3 c, vec3 v)                      chart acceleration of the geodesic with chart velocity v
//   vec4     geo_raise(vec4 p, vec3 conormal)               unit normal of a surface with this chart conormal
//   vec3     geo_lower(vec4 p, vec4 v)                      chart conormal of a tangent vector: raise, up to length
//   Geodesic geo_apply(Isometry m, Geodesic g)              image of the state under an isometry
//   Geodesic geo_cross(Isometry m, vec4 plane, Geodesic g)  passage through the face `plane`, m folded as in Rust
//
// The curve parameter is the geometry's own: 0 at the start, increasing with arc length, chosen so that exits
// are cheap; that of geo_flow where geodesics are curves in the chart. A segment for traversal goes from chart(g) to
// chart(geo_advance(g, u)): straight where geodesics are straight in the chart, so there geo_arc returns u_max; elsewhere
// along an arc of a parabola. There a path takes several segments to the next face, and a segment's hit is refined onto
// the curve. GEO_STRAIGHT decides that at compile time.

const bool GEO_STRAIGHT = true;

vec4 geo_base() {
    return vec4(0.0, 0.0, 0.0, 1.0);
}

float geo_inner(vec4 p, vec4 u, vec4 v) {
    return dot(u.xyz, v.xyz);
}

Geodesic geo_flow(Geodesic g, float t) {
    return Geodesic(vec4(g.point.xyz + t * g.velocity.xyz, 1.0), g.velocity);
}

vec4 geo_log(vec4 p, vec4 q, out float length_out) {
    vec3 difference = q.xyz - p.xyz;
    length_out = length(difference);
    return length_out > 0.0 ? vec4(difference / length_out, 0.0) : vec4(1.0, 0.0, 0.0, 0.0);
}

float geo_closeness(vec4 p, vec4 q) {
    vec3 d = p.xyz - q.xyz;
    return -dot(d, d);
}

float geo_area_density(Geodesic g, float t) {
    return t * t;
}

float geo_length(Geodesic g, float u) {
    return u;
}

float geo_parameter_at(Geodesic g, float t) {
    return t;
}

Geodesic geo_advance(Geodesic g, float u) {
    return geo_flow(g, u);
}

float geo_side(vec4 p, vec4 plane) {
    return dot(plane.xyz, p.xyz) + plane.w;
}

float geo_exit(Geodesic g, vec4 plane, float reach) {
    float rate = dot(plane.xyz, g.velocity.xyz);
    return rate > IO_ALONG_FACE ? max(-geo_side(g.point, plane) / rate, 0.0) : M_INFINITY;
}

float geo_arc(Geodesic g, float u_max, float tolerance) {
    return u_max;
}

float geo_parameter(Geodesic g, vec3 c) {
    return dot(c - g.point.xyz, g.velocity.xyz);
}

Geodesic geo_restore(Geodesic g) {
    return Geodesic(g.point, vec4(normalize(g.velocity.xyz), 0.0));
}

vec3 geo_chart(vec4 p) {
    return p.xyz;
}

vec4 geo_unchart(vec3 c) {
    return vec4(c, 1.0);
}

vec4 geo_unchart_vector(vec4 p, vec3 dc) {
    return vec4(dc, 0.0);
}

vec3 geo_chart_vector(vec4 p, vec4 v) {
    return v.xyz;
}

vec3 geo_spray(vec3 c, vec3 v) {
    return vec3(0.0);
}

vec4 geo_raise(vec4 p, vec3 conormal) {
    return vec4(normalize(conormal), 0.0);
}

vec3 geo_lower(vec4 p, vec4 v) {
    return v.xyz;
}

Geodesic geo_apply(Isometry m, Geodesic g) {
    mat3 linear = mat3(m.linear);
    return Geodesic(vec4(linear * g.point.xyz + m.linear[3].xyz, 1.0), vec4(linear * g.velocity.xyz, 0.0));
}

Geodesic geo_cross(Isometry folded, vec4 plane, Geodesic g) {
    vec3 normal = plane.xyz;
    g.point.xyz -= normal * (2.0 * geo_side(g.point, plane));
    g.velocity.xyz -= normal * (2.0 * dot(normal, g.velocity.xyz));
    return geo_apply(folded, g);
}
