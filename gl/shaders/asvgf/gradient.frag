// One iteration of the à-trous wavelet that spreads the sparse gradients. Schied et al. 2018, sec. 4.3.
//
// STEP: distance of the taps, in strata. FIRST: the input comes from the tracer. JOINT: direct and indirect are one
// signal. PAIR: only this pair of the input's channels counts, 0 or 1. SIGMA_N_SQUARINGS: log2 of the normal exponent,
// or -1 where it is no power of two. Changes are filtered with their sign, so that what is left of their noise cancels.

#include "common/finite.glsl"

uniform sampler2D in_change;  // change of direct light, the larger of now and then; the same for indirect
uniform sampler2D in_surface; // normal, depth
uniform sampler2D in_slope;   // of depth, per pixel
#if HAS_IN_LIGHT
uniform sampler2D in_light; // mean and variance of direct light; of indirect
#endif
uniform float u_sigma_z;
uniform float u_sigma_n;
uniform float u_sigma_l;
uniform float u_pixel_size;

layout(location = 0) out vec4 out_change;

const float SIDE = 3.0; // pixels in a stratum's side

vec4 change_at(ivec2 q) {
    vec4 c = texelFetch(in_change, q, 0);
#if FIRST
    c = is_finite(c) ? c : vec4(0.0);
#ifdef PAIR
    c = vec4(PAIR == 0 ? c.xy : c.zw, 0.0, 0.0);
#endif
#if JOINT
    // What was and what is, each the sum of both signals.
    vec2 then = vec2(c.x > 0.0 ? c.y - c.x : c.y, c.z > 0.0 ? c.w - c.z : c.w);
    vec2 now = vec2(c.x > 0.0 ? c.y : c.y + c.x, c.z > 0.0 ? c.w : c.w + c.z);
    c = vec4(c.x + c.z, max(now.x + now.y, then.x + then.y), 0.0, 0.0);
#endif
#endif
    return c;
}

float normal_weight(float w) {
    w = max(w, 0.0);
#if SIGMA_N_SQUARINGS >= 0
    for (int i = 0; i < SIGMA_N_SQUARINGS; ++i) w *= w;
#else
    w = pow(w, u_sigma_n);
#endif
    return w;
}

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy), size = textureSize(in_change, 0);
    vec4 surface = texelFetch(in_surface, p, 0);
    vec2 slope = texelFetch(in_slope, p, 0).xy;
    float floor_z = 0.1 * u_pixel_size * surface.w;
#if HAS_IN_LIGHT
    vec4 light = texelFetch(in_light, p, 0);
    // The mean of nine samples has a ninth of their variance; blurred, as that of the colour is.
    vec2 variance = vec2(0.0);
    for (int i = 0; i < 9; ++i) {
        ivec2 d = ivec2(i % 3, i / 3) - 1;
        vec2 w = vec2(d.x == 0 ? 0.5 : 0.25, d.y == 0 ? 0.5 : 0.25);
        variance += w.x * w.y * texelFetch(in_light, clamp(p + d, ivec2(0), size - 1), 0).yw / 9.0;
    }
    vec2 inverse_l = 1.0 / (u_sigma_l * sqrt(variance) + 1e-6);
#endif
    vec4 sum = vec4(0.0);
    vec2 total = vec2(0.0);
    for (int i = 0; i < 9; ++i) {
        ivec2 d = (ivec2(i % 3, i / 3) - 1) * STEP;
        ivec2 q = p + d;
        if (any(greaterThanEqual(uvec2(q), uvec2(size)))) continue;
        vec4 s = texelFetch(in_surface, q, 0);
        vec2 away = SIDE * vec2(d);
        float range = u_sigma_z * abs(dot(slope, away)) + floor_z * length(away) + 1e-30;
        float e = abs(surface.w - s.w) / range;
        float w = (d.x == 0 ? 1.0 : 0.5) * (d.y == 0 ? 1.0 : 0.5) * normal_weight(dot(surface.xyz, s.xyz));
        vec2 both = vec2(e);
#if HAS_IN_LIGHT
        both += abs(light.xz - texelFetch(in_light, q, 0).xz) * inverse_l;
#endif
        vec2 weight = w * exp(-both);
        weight = vec2(sane_weight(weight.x), sane_weight(weight.y));
        if (i == 4) weight = vec2(1.0); // the centre counts in full, whatever its surface
        sum += weight.xxyy * change_at(q);
        total += weight;
    }
    out_change = sum / total.xxyy;
}
