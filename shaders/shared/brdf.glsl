// Reflection of a surface, from inner products alone, so that it is the same function in every geometry:
// Lambert plus the Trowbridge-Reitz (GGX) microfacet lobe of the glTF 2.0 specification, appendix B.
#ifndef BRDF_GLSL
#define BRDF_GLSL

// Reflectance times pi times n.l; nl, nv: normal with light and viewer, lv: light with viewer.
vec3 brdf(vec3 base_color, float metallic, float roughness, float nl, float nv, float lv) {
    // Below this roughness the highlight of a point light is smaller than any pixel.
    float alpha = max(roughness * roughness, 2e-3);
    float a2 = alpha * alpha;
    nv = max(nv, 1e-4);
    float half_length2 = max(2.0 + 2.0 * lv, 1e-8);
    float nh2 = min((nl + nv) * (nl + nv) / half_length2, 1.0);
    float vh = sqrt(half_length2) * 0.5;
    float d = nh2 * (a2 - 1.0) + 1.0;
    float distribution = a2 / (d * d);
    float visibility = 0.5 / (nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2));
    vec3 f0 = mix(vec3(0.04), base_color, metallic);
    float m = 1.0 - min(vh, 1.0);
    vec3 fresnel = f0 + (1.0 - f0) * (m * m * m * m * m);
    vec3 diffuse = (1.0 - fresnel) * (1.0 - metallic) * base_color;
    return (diffuse + fresnel * distribution * visibility) * nl;
}

#endif
