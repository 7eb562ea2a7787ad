// Elementary functions with known errors.
//
// Vulkan promises little for the built-in ones (sin and cos: absolute error 2^-11 inside [-pi, pi] and nothing
// outside), and drivers use the freedom. Geodesics need a few units in the last place at any argument, so they
// are computed here. Minimax polynomials for sin, cos and atan: Moshier, Cephes 2.8, single precision.
// Their errors are measured through the geometries by the tests `twins`.
#ifndef MATH_GLSL
#define MATH_GLSL

const float M_PI = 3.14159265358979;
const float M_HALF_PI = 1.57079632679490;
const float M_QUARTER_PI = 0.785398163397448;
const float M_INFINITY = uintBitsToFloat(0x7f800000u);

// A whole number between -2^22 and 2^22 as an integer: by the bits of a float that ends with the units. Software converts
// numbers one by one, with care for what does not fit, and hardware at a quarter of its speed.
int m_whole(float k) {
    return floatBitsToInt(k + 12582912.0) - 0x4b400000;
}

ivec3 m_whole(vec3 k) {
    return floatBitsToInt(k + 12582912.0) - 0x4b400000;
}

// x - k * (A + B + C + D) without rounding in the products: each part of the constant has at most 12 significant
// bits and k is split into two halves of 12 bits, both towards zero: a small negative k must not become a large
// one minus a large one.
float m_reduce(float x, float k, vec4 parts) {
    precise float high = trunc(k * (1.0 / 4096.0)) * 4096.0;
    precise float low = k - high;
    precise float r = x;
    r = r - high * parts.x;
    r = r - low * parts.x;
    r = r - high * parts.y;
    r = r - low * parts.y;
    r = r - high * parts.z;
    r = r - low * parts.z;
    r = r - high * parts.w;
    r = r - low * parts.w;
    return r;
}

// pi/2 in four parts of 12 bits.
const vec4 M_HALF_PI_PARTS = vec4(1.5703125, 4.837512969970703125e-4, 7.54953362047672271728515625e-8, 2.56328291925456142e-12);

// (sin x, cos x), |x| < 1e7; beyond that f32 no longer resolves an angle.
vec2 m_sincos(float x) {
    float k = floor(x * (1.0 / M_HALF_PI) + 0.5);
    float r = m_reduce(x, k, M_HALF_PI_PARTS);
    float z = r * r;
    float s = ((-1.9515295891e-4 * z + 8.3321608736e-3) * z - 1.6666654611e-1) * z * r + r;
    float c = ((2.443315711809948e-5 * z - 1.388731625493765e-3) * z + 4.166664568298827e-2) * z * z - 0.5 * z + 1.0;
    int quadrant = m_whole(4.0 * fract(0.25 * k));
    vec2 turned = (quadrant & 1) == 0 ? vec2(s, c) : vec2(c, s);
    return vec2(quadrant >= 2 ? -turned.x : turned.x, quadrant == 1 || quadrant == 2 ? -turned.y : turned.y);
}

// Angle of (cos, sin) in [-pi, pi].
float m_atan(float sine, float cosine) {
    float low = min(abs(sine), abs(cosine));
    float high = max(abs(sine), abs(cosine));
    if (high == 0.0) return 0.0;
    float q = low / high;
    // tan(pi/8): fold the upper half of [0, 1] down once more.
    bool folded = q > 0.414213562;
    float x = folded ? (low - high) / (low + high) : q;
    float z = x * x;
    float a = (((8.05374449538e-2 * z - 1.38776856032e-1) * z + 1.99777106478e-1) * z - 3.33329491539e-1) * z * x + x;
    if (folded) a += M_QUARTER_PI;
    if (abs(sine) > abs(cosine)) a = M_HALF_PI - a;
    if (cosine < 0.0) a = M_PI - a;
    return sine < 0.0 ? -a : a;
}

// e^x / 2: halved so that cosh and sinh reach the end of the range.
float m_half_exp(float x) {
    float k = floor(x * 1.44269504088896 + 0.5);
    // ln 2 in a part of 9 bits and a rest.
    precise float r = x - k * 0.693359375;
    r = r + k * 2.12194440054690583e-4;
    float p = 1.0 + r * (1.0 + r * (0.5 + r * (1.66666667e-1 + r * (4.16666667e-2 + r * (8.33333333e-3 + r * (1.38888889e-3 + r * 1.98412698e-4))))));
    if (k > 127.0) return k > 129.0 ? M_INFINITY : ldexp(p, 120) * exp2(k - 121.0);
    return k < -124.0 ? 0.0 : p * intBitsToFloat((m_whole(k) + 126) << 23);
}

// (sinh x, cosh x).
vec2 m_sinhcosh(float x) {
    float a = abs(x);
    float up = m_half_exp(a);
    float down = a > 40.0 ? 0.0 : 0.25 / up;
    float z = x * x;
    float s = a < 1.0
        ? a * (1.0 + z * (1.66666667e-1 + z * (8.33333333e-3 + z * (1.98412698e-4 + z * (2.75573192e-6 + z * 2.50521084e-8)))))
        : up - down;
    return vec2(x < 0.0 ? -s : s, up + down);
}

// Natural logarithm of x > 0, normal numbers.
float m_log(float x) {
    int e;
    float m = frexp(x, e);
    if (m < 0.707106781) {
        m *= 2.0;
        e -= 1;
    }
    float s = (m - 1.0) / (m + 1.0);
    float z = s * s;
    float log_m = 2.0 * s * (1.0 + z * (3.33333333e-1 + z * (2.0e-1 + z * (1.42857143e-1 + z * 1.11111111e-1))));
    return float(e) * 0.693359375 + (log_m - float(e) * 2.12194440054690583e-4);
}

// Inverse hyperbolic tangent, |x| < 1.
float m_atanh(float x) {
    float z = x * x;
    if (z < 0.04) return x * (1.0 + z * (3.33333333e-1 + z * (2.0e-1 + z * (1.42857143e-1 + z * (1.11111111e-1 + z * 9.09090909e-2)))));
    float a = abs(x);
    if (a >= 1.0) return x < 0.0 ? -M_INFINITY : M_INFINITY;
    float y = 0.5 * m_log((1.0 + a) / (1.0 - a));
    return x < 0.0 ? -y : y;
}

// Inverse hyperbolic sine.
float m_asinh(float x) {
    float a = abs(x);
    if (a < 0.2) return m_atanh(x / sqrt(1.0 + x * x));
    float y = a > 1e15 ? m_log(a) + 0.693147181 : m_log(a + sqrt(a * a + 1.0));
    return x < 0.0 ? -y : y;
}

// Hyperbolic tangent.
float m_tanh(float x) {
    vec2 sc = m_sinhcosh(min(abs(x), 20.0));
    float y = sc.x / sc.y;
    return x < 0.0 ? -y : y;
}

// The entire functions (cosh sqrt z, sinh sqrt z / sqrt z); cos and sin for negative z. Twins: src/geometry/curved.rs.
vec2 m_cosh_sinhc(float z) {
    float root = sqrt(abs(z));
    if (root < 0.5) {
        return vec2(
            1.0 + z * (0.5 + z * (4.16666667e-2 + z * (1.38888889e-3 + z * 2.48015873e-5))),
            1.0 + z * (1.66666667e-1 + z * (8.33333333e-3 + z * (1.98412698e-4 + z * 2.75573192e-6))));
    }
    vec2 sc = z > 0.0 ? m_sinhcosh(root) : m_sincos(root);
    return vec2(sc.y, sc.x / root);
}

// ((cosh sqrt z - 1) / z, (sinh sqrt z - sqrt z) / sqrt z^3).
vec2 m_integrals(float z) {
    float half_sinhc = m_cosh_sinhc(0.25 * z).y;
    float third = abs(z) < 1.0
        ? 1.66666667e-1 * (1.0 + z * (0.05 + z * (1.19047619e-3 + z * (1.65343915e-5 + z * (1.50312650e-7 + z * 9.63542e-10)))))
        : (m_cosh_sinhc(z).y - 1.0) / z;
    return vec2(0.5 * half_sinhc * half_sinhc, third);
}

// t >= 0 with tanh(sqrt(q) t) / sqrt(q) = numerator / denominator, numerator >= 0; tan for negative q, where a negative
// ratio is met behind the quarter turn. Infinite where there is none.
float m_artanh_over(float q, float numerator, float denominator) {
    float root = sqrt(abs(q));
    if (q < 0.0 && !(root * numerator < 0.1 * denominator)) return m_atan(root * numerator, denominator) / root;
    if (!(denominator > 0.0 && (q <= 0.0 || root * numerator < denominator))) return M_INFINITY;
    float ratio = numerator / denominator;
    float z = q * ratio * ratio;
    if (abs(z) < 0.04) {
        return ratio * (1.0 + z * (3.33333333e-1 + z * (0.2 + z * (1.42857143e-1 + z * 1.11111111e-1))));
    }
    return m_atanh(root * ratio) / root;
}

// First t >= 0 at which (start + 2 rate s + bend s^2) / (1 - q s^2), s = tanh(sqrt(q) t / 2) / sqrt(q), passes from
// negative to positive.
float m_first_passage(float q, float start, float rate, float bend, float along) {
    start = min(start, 0.0);
    float discriminant = rate * rate - bend * start;
    if (discriminant < 0.0) return M_INFINITY;
    float root = sqrt(discriminant);
    return 2.0 * (rate > along ? m_artanh_over(q, -start, rate + root) : m_artanh_over(q, root - rate, bend));
}

// Steps of full care towards a first zero, and the shortest step from then on: see `first_zero` in the twin.
const int M_PATIENCE = 40;
const float M_STRIDE = 4e-3;

// Step towards the first zero of a function that is negative, with this value and derivative and second derivatives
// up to `bend`: no zero is stepped over.
float m_safe_step(float value, float rate, float bend) {
    bend = max(bend, 1e-30);
    float root = sqrt(rate * rate - 2.0 * bend * value);
    return rate > 0.0 ? -2.0 * value / (rate + root) : (root - rate) / bend;
}

// Cube root of a positive number, to 2.2e-5 of it: a third of the exponent, and one step of Halley's method. A third of the
// bits by shifts (Warren: Hacker's delight, 2012, 11-2): a quarter and a sixteenth and so on.
float m_cube_root(float x) {
    int third = (floatBitsToInt(x) >> 2) + (floatBitsToInt(x) >> 4);
    third += third >> 4;
    third += third >> 8;
    third += third >> 16;
    float root = intBitsToFloat(third + 709958130);
    float cube = root * root * root;
    return root * ((cube + 2.0 * x) / (2.0 * cube + x));
}

// The longest arc whose chart's third derivative is at most `third`: it deviates by third h^3 / 96 (Segment::along in
// src/geometry/mod.rs). Geometries bound the derivative over a step h by a function of h: what no step at all allows is too
// long, and what that allows too short.
float m_arc(float third, float tolerance, float limit) {
    return min(m_cube_root(96.0 * tolerance / max(third, 1e-30)), limit);
}

// The longest arc between these two, on the safe side if the bound is convex: see longest_arc in src/geometry/curved.rs.
// Both may be the limit: 0, or less by a rounding, or infinite.
float m_arc_between(float most, float least) {
    float apart = least < most ? 1.0 - least / most : 0.0;
    return least * (1.0 + 0.65 * apart * apart);
}

// Bounds whose ratio is less than this are looked for again, so often at most.
const float M_ARC_APART = 1.0 / 3.0;
const int M_ARC_ROUNDS = 4;

// Returns the longest arc by a convex bound THIRD(h) that may rise by more than the cube of 3. Asked before the loop: software that
// runs invocations in lockstep enters a loop even if none of them does.
#define M_RETURN_LONGEST_ARC(THIRD, tolerance, limit) \
    float most = m_arc(THIRD(0.0), tolerance, limit); \
    float least = m_arc(THIRD(most), tolerance, limit); \
    if (least < M_ARC_APART * most) { \
        for (int i = 1; i < M_ARC_ROUNDS && least < M_ARC_APART * most; i++) { \
            most = m_arc(THIRD(m_arc_between(most, least)), tolerance, limit); \
            least = m_arc(THIRD(most), tolerance, limit); \
        } \
    } \
    return m_arc_between(most, least)

#endif
