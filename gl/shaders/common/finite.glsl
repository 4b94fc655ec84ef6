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
