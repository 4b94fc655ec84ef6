// Where was this surface point in the last frame, and which of the texels there saw the same surface?
//
// Schied et al. 2017, sec. 4.1. One pass for all signals of a frame; temporal/accumulate.frag blends with its answer.

#include "common/finite.glsl"
#include "common/octahedral.glsl"

uniform sampler2D in_motion;   // uv offset, expected previous depth, object id
uniform sampler2D in_surface;  // normal, depth
uniform sampler2D in_gradient; // of depth, per pixel
#if HAS_IN_PREV_NORMAL
uniform sampler2D in_prev_normal;
#endif
uniform sampler2D prev_guide; // as out_guide
uniform bool u_history_valid;
uniform float u_depth_tolerance;
uniform float u_normal_tolerance;
uniform float u_max_history;
uniform float u_pixel_size;

layout(location = 0) out vec4 out_reprojection;
layout(location = 1) out vec4 out_guide;

const float MIN_COSINE = 0.05;
const float COSINE_SCALE = 0.984375; // length and cosine share a channel: integer part and fraction

// Why a pixel has no history, as gl/passes/temporal.py explains to people (REJECTIONS). From OTHER_OBJECT on in the
// order of the tests that a texel must pass.
const float NO_HISTORY = -1.0;
const float NO_SURFACE = -2.0;
const float OUT_OF_VIEW = -3.0;
const float OTHER_OBJECT = -4.0;
const float OTHER_DEPTH = -5.0;
const float OTHER_NORMAL = -6.0;
const float TOO_SHORT = -7.0;

ivec2 size;
vec4 motion;
vec3 normal;
vec2 gradient;
vec2 lattice; // position in the last frame, in texels whose centres are integers
float reason; // of the texel that passed most tests

// History length of a texel of the last frame if it saw this surface, otherwise 0; y: cosine of its view angle.
vec2 test(ivec2 tap) {
    if (any(greaterThanEqual(uvec2(tap), uvec2(size)))) return vec2(0.0);
    vec4 guide = texelFetch(prev_guide, tap, 0);
    // The slope is this frame's: the surface has hardly turned since, and a pixel of slack covers what it has.
    float expected = motion.z + dot(gradient, vec2(tap) - lattice);
    float limit = u_depth_tolerance * motion.z + abs(gradient.x) + abs(gradient.y);
    bool object = abs(guide.z - motion.w) < 0.5;
    bool depth = abs(guide.y - expected) <= limit;
    bool facing = dot(decode_normal(guide.x), normal) >= u_normal_tolerance;
    float verdict = !object ? OTHER_OBJECT : !depth ? OTHER_DEPTH : !facing ? OTHER_NORMAL : TOO_SHORT;
    reason = min(reason, verdict);
    return verdict == TOO_SHORT ? vec2(floor(guide.w), fract(guide.w)) : vec2(0.0);
}

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    size = textureSize(in_motion, 0);
    motion = texelFetch(in_motion, p, 0);
    vec4 surface = texelFetch(in_surface, p, 0);
    gradient = texelFetch(in_gradient, p, 0).xy;
#if HAS_IN_PREV_NORMAL
    normal = texelFetch(in_prev_normal, p, 0).xyz;
#else
    normal = surface.xyz;
#endif
    // Cosine between normal and view ray from the slope: depth changes by pixel_size·z·tan(angle) per pixel.
    float slope = length(gradient) / max(u_pixel_size * surface.w, 1e-30);
    float cosine = max(inversesqrt(1.0 + slope * slope), MIN_COSINE);

    lattice = vec2(p) + motion.xy * vec2(size);
    float mask = 0.0, history = 0.0;
    bool hit = is_finite(motion) && is_finite(vec4(surface)) && motion.w >= 0.0;
    bool in_view = motion.z > 0.0 && all(greaterThan(lattice, vec2(-1.5))) && all(lessThan(lattice, vec2(size) + 0.5));
    reason = !u_history_valid ? NO_HISTORY : !hit ? NO_SURFACE : OUT_OF_VIEW;
    if (u_history_valid && hit && in_view) {
        // 2x2 bilinear taps; those that fail are dropped and the weights renormalised.
        ivec2 corner = ivec2(floor(lattice));
        vec2 f = lattice - vec2(corner);
        float total = 0.0, lengths = 0.0, cosines = 0.0;
        for (int i = 0; i < 4; ++i) {
            ivec2 d = ivec2(i & 1, i >> 1);
            vec2 t = test(corner + d);
            float w = (d.x == 1 ? f.x : 1.0 - f.x) * (d.y == 1 ? f.y : 1.0 - f.y);
            if (t.x > 0.0 && w > 1e-4) {
                mask += float(1 << i);
                total += w;
                lengths += w * t.x;
                cosines += w * t.y;
            }
        }
        // A footprint that is valid in part is worth less history (NRD's footprint quality).
        history = total > 0.0 ? lengths / total * sqrt(min(total, 1.0)) : 0.0;
        float before = total > 0.0 ? cosines / total : 0.0;

        // None of the four: the unweighted mean of those in 3x3 around the point that pass. The loop is empty, not
        // masked, where it is not needed: a software rasteriser runs both sides of a branch.
        int last = total > 0.0 ? -1 : 8;
        float count = 0.0;
        for (int i = 0; i <= last; ++i) {
            vec2 t = test(ivec2(floor(lattice + 0.5)) + ivec2(i % 3 - 1, i / 3 - 1));
            if (t.x > 0.0) {
                mask += float(16 << i);
                count += 1.0;
                history += t.x;
                before += t.y;
            }
        }
        if (count > 0.0) {
            history /= count;
            before /= count;
        }
        // Seen at a much more grazing angle before, the history holds less detail than the surface shows now (kajiya).
        history *= smoothstep(0.4, 0.8, before / (COSINE_SCALE * cosine));
        history = min(floor(history + 0.5), u_max_history - 1.0);
        if (history < 1.0) mask = 0.0;
    }
    history = mask > 0.0 ? history : 0.0;
    out_reprojection = vec4(lattice, mask > 0.0 ? mask : reason, history);
    out_guide = vec4(encode_normal(surface.xyz), surface.w, motion.w, history + 1.0 + COSINE_SCALE * cosine);
}
