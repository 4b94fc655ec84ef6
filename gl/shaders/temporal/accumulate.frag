// Blend this frame's sample with the history found by temporal/reproject.frag, and the luminance moments with it.
//
// Schied et al. 2017, sec. 4.1 and 4.2: C' = a·C + (1 - a)·C'_prev, moments likewise. HALF: the colour's precision.
// CLAMPED: the history's colour is first brought within the bounds of temporal/neighbourhood.frag. ADAPTIVE: where
// light has changed, the history follows it and counts for less (Schied et al. 2018, sec. 4.4); SIGNAL: which channel
// of λ tells it; POWER: its length becomes N (1 - λ)^u_power, otherwise that of a mean in which the new sample has the
// weight it gets. CENTRED: the second moment is that about the mean (Welford 1962). UNBIASED: h / (h - 1) of it is the
// variance, Bessel's correction.

#include "common/color.glsl"
#include "common/finite.glsl"

uniform sampler2D in_color;
uniform sampler2D in_reprojection;
uniform sampler2D prev_color;   // rgb, standard deviation
uniform sampler2D prev_moments; // first and second luminance moment; z: what was left of the length, if ADAPTIVE
#ifdef CLAMPED
uniform sampler2D in_low;
uniform sampler2D in_high;
#endif
#ifdef ADAPTIVE
uniform sampler2D in_lambda; // xy: λ of direct and indirect light; zw: factors by which they have changed
uniform float u_power;
#endif
uniform bool u_history_valid;
uniform float u_alpha;
uniform float u_alpha_moments;

layout(location = 0) out vec4 out_color;
#ifdef ADAPTIVE
layout(location = 1) out vec4 out_moments;
float left = 0.0; // of the common history's length, for this signal
#else
layout(location = 1) out vec2 out_moments;
#endif

vec3 color = vec3(0.0);
vec2 moments = vec2(0.0);
float origin = 0.0; // what the first moment is relative to
float total = 0.0;

void gather(ivec2 tap, float w) {
    vec3 c = texelFetch(prev_color, tap, 0).rgb;
    vec4 before = texelFetch(prev_moments, tap, 0);
    vec2 m = before.xy;
    // Select, do not multiply: 0 · NaN is NaN, and a NaN in a recursive filter stays for ever.
#ifdef ADAPTIVE
    bool sound = is_finite(c) && is_finite(before.xyz);
#else
    bool sound = is_finite(c) && is_finite(m);
#endif
    if (sound) {
#ifdef CENTRED
        // The variance of texels put together is theirs and that of their means.
        if (total == 0.0) origin = m.x;
        m.x -= origin;
        m.y += m.x * m.x;
#endif
        color += w * c;
        moments += w * m;
        total += w;
#ifdef ADAPTIVE
        left += w * before.z;
#endif
    }
}

// A sample's luminance `l` comes to moments of which it gets the share `a`.
vec2 blend_moments(vec2 m, float l, float a) {
#ifdef CENTRED
    float d = l - m.x;
    return vec2(m.x + a * d, (1.0 - a) * (m.y + a * d * d));
#else
    return mix(m, vec2(l, l * l), a);
#endif
}

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    vec3 c = texelFetch(in_color, p, 0).rgb;
    bool usable = is_finite(c);
    c = usable ? clamp_radiance(c) : vec3(0.0); // clamped before it is squared
    float l = luminance(c);
    vec2 m = blend_moments(vec2(l, 0.0), l, 1.0);

    vec4 found = texelFetch(in_reprojection, p, 0);
    int mask = u_history_valid ? int(max(found.z, 0.0)) : 0; // below 0 it says why there is none
    ivec2 corner = ivec2(floor(found.xy));
    vec2 f = found.xy - vec2(corner);
    if ((mask & 15) != 0) {
        if ((mask & 1) != 0) gather(corner, (1.0 - f.x) * (1.0 - f.y));
        if ((mask & 2) != 0) gather(corner + ivec2(1, 0), f.x * (1.0 - f.y));
        if ((mask & 4) != 0) gather(corner + ivec2(0, 1), (1.0 - f.x) * f.y);
        if ((mask & 8) != 0) gather(corner + ivec2(1, 1), f.x * f.y);
    }
    ivec2 centre = ivec2(floor(found.xy + 0.5));
    int last = mask > 15 ? 8 : -1;
    for (int i = 0; i <= last; ++i)
        if ((mask & (16 << i)) != 0) gather(centre + ivec2(i % 3 - 1, i / 3 - 1), 1.0);

    float n = 0.0, void_share = 0.0; // frames behind the history, and what of it the change of light takes away
    if (total > 0.0) {
        color /= total;
        moments /= total;
#ifdef CLAMPED
        color = clamp(color, texelFetch(in_low, p, 0).rgb, texelFetch(in_high, p, 0).rgb);
#endif
        // A plain running mean until the new sample's share has fallen to alpha, exponential from then on.
        n = found.w;
#ifdef CENTRED
        moments = vec2(origin + moments.x, max(moments.y - moments.x * moments.x, 0.0));
#endif
#ifdef ADAPTIVE
        n *= left / total;
        vec4 change = texelFetch(in_lambda, p, 0);
        void_share = clamp(change[SIGNAL], 0.0, 1.0);
        // What was seen in other light, as it would be in this one.
        float factor = change[2 + SIGNAL];
        color = clamp_radiance(color * factor);
        moments *= vec2(factor, factor * factor);
#if POWER
        n *= pow(max(1.0 - void_share, 1e-9), u_power); // pow(0, 0) is undefined
#endif
#endif
        float share = 1.0 / (n + 1.0);
        c = usable ? mix(color, c, mix(max(share, u_alpha), 1.0, void_share)) : color;
        m = usable ? blend_moments(moments, l, mix(max(share, u_alpha_moments), 1.0, void_share)) : moments;
    }
#ifdef CENTRED
    float variance = m.y;
#else
    float variance = max(m.y - m.x * m.x, 0.0); // the difference may round below zero
#endif
#ifdef UNBIASED
    variance *= (n + 1.0) / max(n, 1.0); // one sample has none
#endif
    out_color = vec4(c, sqrt(variance));
#if HALF
    out_color = round_to_half(out_color);
#endif
#ifdef ADAPTIVE
#if !POWER
    n = max((n + 1.0) / (1.0 + void_share * n) - 1.0, 0.0);
#endif
    out_moments = vec4(m, (n + 1.0) / (found.w + 1.0), n);
#else
    out_moments = m;
#endif
}
