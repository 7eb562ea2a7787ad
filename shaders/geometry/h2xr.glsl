// The hyperbolic plane times a line, x^2 + y^2 - w^2 = -1. Twin: src/geometry/h2xr.rs. Contract: e3.glsl.

const bool GEO_STRAIGHT = false;

const float PRODUCT_CURVATURE = -1.0;
#include "shared/product.glsl"
