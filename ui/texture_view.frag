// One texture of the graph as a picture for the screen.
//
// MODE: one of those below. SAMPLER: type of the texture. SWIZZLE: the channels that are shown; ALL: the same, the last
// repeated to make four. ENCODE: whether values are linear light. REASON: channel that says why a history was rejected,
// if there is one. Colours, in sRGB, and scales are those of ui/textures.py.

#include "common/color.glsl"
#include "common/finite.glsl"
#include "common/octahedral.glsl"

#define SAMPLE 0
#define RANGE 1
#define NORMAL 2
#define OCTAHEDRAL 3
#define MOTION 4
#define HISTORY 5
#define IDENTITY 6

uniform SAMPLER in_texture;
uniform vec2 u_origin; // where on the screen the texture's corner lies, in pixels
uniform vec2 u_scale;  // texels per pixel of the screen
uniform float u_low;   // what is shown as black, and as white
uniform float u_high;
uniform float u_gain;  // 2 to the exposure
uniform vec2 u_size;   // of the frame, pixels
uniform ivec2 u_pixel; // texel in the middle of the magnifier
uniform float u_grid;  // pixels of the screen per texel of the magnifier, 0 without

layout(location = 0) out vec4 out_color;

const float TAU = 6.28318531;
const vec3 ramp[] = RAMP;
const vec3 rejected[] = REJECTED; // by reason: -1, -2, ...

vec3 hue(float turn) { return clamp(abs(fract(turn + vec3(0.0, 2.0, 1.0) / 3.0) * 6.0 - 3.0) - 1.0, 0.0, 1.0); }

#if MODE == SAMPLE
vec3 shown(vec4 v) { return v.SWIZZLE; }
#elif MODE == RANGE
vec3 shown(vec4 v) {
    vec3 c = (v.SWIZZLE - u_low) / max(u_high - u_low, 1e-30) * u_gain;
#if ENCODE
    return encode_srgb(c);
#else
    return c;
#endif
}
#elif MODE == NORMAL
vec3 shown(vec4 v) { return v.SWIZZLE == vec3(0.0) ? vec3(0.0) : v.SWIZZLE * 0.5 + 0.5; }
#elif MODE == OCTAHEDRAL
vec3 shown(vec4 v) { return decode_normal(v.SWIZZLE) * 0.5 + 0.5; }
#elif MODE == MOTION
// The hue is the direction, the brightness the length on a logarithmic scale.
vec3 shown(vec4 v) {
    vec2 pixels = v.SWIZZLE * u_size;
    if (pixels == vec2(0.0)) return vec3(0.0); // which has no direction
    float bright = log2(1.0 + length(pixels) * u_gain) / log2(1.0 + FULL_MOTION);
    return mix(vec3(1.0), hue(atan(pixels.y, pixels.x) / TAU), 0.85) * min(bright, 1.0);
}
#elif MODE == HISTORY
vec3 shown(vec4 v) {
#ifdef REASON
    float reason = v.REASON;
    if (reason < 0.0) return rejected[min(int(-reason), rejected.length()) - 1];
#endif
    float share = clamp(log2(max(v.SWIZZLE, 1.0)) / log2(RAMP_END), 0.0, 1.0);
    float at = share * float(ramp.length() - 1);
    int stop = min(int(at), ramp.length() - 2);
    return mix(ramp[stop], ramp[stop + 1], at - float(stop));
}
#elif MODE == IDENTITY
// The multiples of an irrational number, of the golden ratio for the hue, lie far apart where the factors are near.
float scattered(uint id, uint factor) { return float(id * factor) / 4294967296.0; }

vec3 shown(vec4 v) {
    uint id = uint(max(v.SWIZZLE, 0.0) + 0.5);
    float pale = 0.15 + 0.4 * scattered(id, 3242174889u), bright = 0.55 + 0.45 * scattered(id, 2447445413u);
    return v.SWIZZLE < 0.0 ? OUTSIDE : mix(hue(scattered(id, 2654435769u)), vec3(1.0), pale) * bright;
}
#endif

// Lines between the texels of the magnifier, and a frame around the one in its middle.
vec3 with_grid(vec3 c, vec2 at) {
    vec2 inside = fract(at) * u_grid;
    float edge = min(min(inside.x, inside.y), min(u_grid - inside.x, u_grid - inside.y));
    if (ivec2(floor(at)) == u_pixel) return edge < 1.0 ? vec3(0.0) : edge < 2.5 ? vec3(1.0) : c;
    return u_grid >= 6.0 && min(inside.x, inside.y) < 1.0 ? mix(c, vec3(0.5), 0.45) : c;
}

void main() {
    vec2 at = (gl_FragCoord.xy - u_origin) * u_scale;
    ivec2 texel = ivec2(floor(at));
    ivec2 size = textureSize(in_texture, 0);
    vec4 v = vec4(texelFetch(in_texture, clamp(texel, ivec2(0), size - 1), 0));
    vec3 c = shown(v);
#if MODE != SAMPLE
    // Bit by bit: compilers may assume that nothing is NaN. One NaN among several channels outweighs the others.
    uvec4 bits = floatBitsToUint(v.ALL);
    if (any(equal(bits, uvec4(0xff800000u)))) c = NEGATIVE_INFINITE_COLOR;
    if (any(equal(bits, uvec4(0x7f800000u)))) c = INFINITE_COLOR;
    if (any(greaterThan(bits & 0x7fffffffu, uvec4(0x7f800000u)))) c = NAN_COLOR;
    if (texel != clamp(texel, ivec2(0), size - 1)) c = OUTSIDE;
    else if (u_grid > 0.0) c = with_grid(c, at);
    c = clamp(c, 0.0, 1.0);
#endif
    out_color = vec4(c, 1.0);
}
