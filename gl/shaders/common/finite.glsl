// Guards against NaN, infinity and the end of half precision.

// Above this a half overflows to infinity; the largest half is 65504, and rounding may go up.
const float HALF_LIMIT = 65000.0;

// Exponent bits all set: NaN or infinity. isnan() is not enough, compilers may assume that there is none.
bool is_finite(float x) { return (floatBitsToUint(x) & 0x7f800000u) != 0x7f800000u; }
bool is_finite(vec2 v) { return is_finite(v.x) && is_finite(v.y); }
bool is_finite(vec3 v) { return is_finite(v.x) && is_finite(v.y) && is_finite(v.z); }
bool is_finite(vec4 v) { return is_finite(v.xyz) && is_finite(v.w); }

// A radiance that half precision can hold. Only for finite input.
vec3 clamp_radiance(vec3 c) { return clamp(c, vec3(0.0), vec3(HALF_LIMIT)); }

// A filter's weight, at most a rounding above 1; 0 where a guide is NaN or infinite. One comparison: the bit patterns of
// all that is not in [0, 2) are larger.
float sane_weight(float w) { return floatBitsToUint(w) < 0x40000000u ? w : 0.0; }

// The nearest number that half precision can hold. Renderers may round towards zero when they store, and what a
// recursive filter loses in every frame adds up: a running mean over 200 frames would end 5 % too dark.
vec4 round_to_half(vec4 v) {
    vec4 normal = uintBitsToFloat((floatBitsToUint(v) + 0x1000u) & 0xffffe000u); // 10 of 23 bits of the mantissa
    vec4 small = floor(v * 16777216.0 + 0.5) / 16777216.0;                       // multiples of 2^-24 below 2^-14
    return mix(normal, small, lessThan(abs(v), vec4(6.103515625e-5)));
}
