// How much of the light has changed, hence how much of the history is void. Schied et al. 2018, sec. 4.4.
//
// From strata back to pixels: the strata around are weighted by nearness and by likeness of their surface, as upsampling
// by guides does (Kopf et al. 2007). Changes are summed up before they are divided: a stratum without light has no say.
//
// WIDEN: 1 takes the largest of 3x3 strata, whatever their surface. FOLLOW: 1 also tells by which factor the light has
// changed. SIGMA_N_SQUARINGS: log2 of the normal exponent, or -1 where it is no power of two.

#include "common/finite.glsl"

uniform sampler2D in_change; // filtered: change of direct light, the larger of now and then; the same for indirect
uniform sampler2D in_strata; // normal, depth
uniform sampler2D in_surface;
uniform sampler2D in_gradient;
uniform float u_gain;
uniform float u_sigma_z;
uniform float u_sigma_n;
uniform float u_pixel_size;

layout(location = 0) out vec4 out_lambda;

const int SIDE = 3;
const float REACH = 4.5;           // pixels from a stratum's centre to where its weight is 0
const float STRANGER = 1e-4;       // least likeness: on a surface narrower than a stratum those around must do
const float SHARE_FLOOR = 1e-3;    // a signal that is next to nothing of the light can change by all of it unseen
const float LARGEST_FACTOR = 4.0;  // beyond it there is little of the new light in the old

// Change of both signals in parts of the larger of now and then.
vec2 relative(vec4 c) {
    return clamp(c.xz / max(max(c.yw, SHARE_FLOOR * (c.y + c.w)), vec2(1e-30)), -1.0, 1.0);
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
    vec2 slope = abs(texelFetch(in_gradient, p, 0).xy);
    float floor_z = 0.1 * u_pixel_size * surface.w;
    vec4 sum = vec4(0.0);
    vec2 widest = vec2(0.0);
    for (int i = 0; i < 9; ++i) {
        ivec2 q = p / SIDE + ivec2(i % 3, i / 3) - 1;
        if (any(greaterThanEqual(uvec2(q), uvec2(size)))) continue;
        vec4 c = texelFetch(in_change, q, 0);
#if WIDEN
        widest = max(widest, abs(relative(c)));
#endif
        vec4 s = texelFetch(in_strata, q, 0);
        vec2 away = abs(vec2(SIDE * q + 1 - p));
        // The sample of a stratum may lie a pixel from its centre.
        float range = u_sigma_z * dot(slope, away + 1.0) + floor_z * (length(away) + 1.0) + 1e-30;
        float likeness = normal_weight(dot(surface.xyz, s.xyz)) * exp(-abs(surface.w - s.w) / range);
        vec2 near = max(1.0 - away / REACH, 0.0);
        sum += near.x * near.y * (sane_weight(likeness) + STRANGER) * c;
    }
    vec2 change = relative(sum);
#if !WIDEN
    widest = abs(change);
#endif
    vec2 factor = vec2(1.0);
#if FOLLOW
    // Of the light now to the light then: what is not the larger of the two is less by the change.
    factor = mix(1.0 / max(1.0 - change, vec2(1.0 / LARGEST_FACTOR)), 1.0 + change, lessThan(change, vec2(0.0)));
#endif
    out_lambda = round_to_half(vec4(min(u_gain * widest, 1.0), factor));
}
