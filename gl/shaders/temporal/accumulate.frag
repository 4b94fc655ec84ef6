// Blend this frame's sample with the history found by temporal/reproject.frag, and the luminance moments with it.
//
// Schied et al. 2017, sec. 4.1 and 4.2: C' = a·C + (1 - a)·C'_prev, moments likewise. HALF: the colour's precision.
// CLAMPED: the history's colour is first brought within the bounds of temporal/neighbourhood.frag. CENTRED: the
// second moment is that about the mean (Welford 1962). UNBIASED: h / (h - 1) of it is the variance, Bessel's correction.

#include "common/color.glsl"
#include "common/finite.glsl"

uniform sampler2D in_color;
uniform sampler2D in_reprojection;
uniform sampler2D prev_color;   // rgb, standard deviation
uniform sampler2D prev_moments; // first and second luminance moment
#ifdef CLAMPED
uniform sampler2D in_low;
uniform sampler2D in_high;
#endif
uniform bool u_history_valid;
uniform float u_alpha;
uniform float u_alpha_moments;

layout(location = 0) out vec4 out_color;
layout(location = 1) out vec2 out_moments;

vec3 color = vec3(0.0);
vec2 moments = vec2(0.0);
float origin = 0.0; // what the first moment is relative to
float total = 0.0;

void gather(ivec2 tap, float w) {
    vec3 c = texelFetch(prev_color, tap, 0).rgb;
    vec2 m = texelFetch(prev_moments, tap, 0).xy;
    // Select, do not multiply: 0 · NaN is NaN, and a NaN in a recursive filter stays for ever.
    if (is_finite(c) && is_finite(m)) {
#ifdef CENTRED
        // The variance of texels put together is theirs and that of their means.
        if (total == 0.0) origin = m.x;
        m.x -= origin;
        m.y += m.x * m.x;
#endif
        color += w * c;
        moments += w * m;
        total += w;
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

    if (total > 0.0) {
        color /= total;
        moments /= total;
#ifdef CLAMPED
        color = clamp(color, texelFetch(in_low, p, 0).rgb, texelFetch(in_high, p, 0).rgb);
#endif
        // A plain running mean until the new sample's share has fallen to alpha, exponential from then on.
        float share = 1.0 / (found.w + 1.0);
        c = usable ? mix(color, c, max(share, u_alpha)) : color;
#ifdef CENTRED
        moments = vec2(origin + moments.x, max(moments.y - moments.x * moments.x, 0.0));
#endif
        m = usable ? blend_moments(moments, l, max(share, u_alpha_moments)) : moments;
    }
#ifdef CENTRED
    float variance = m.y;
#else
    float variance = max(m.y - m.x * m.x, 0.0); // the difference may round below zero
#endif
#ifdef UNBIASED
    variance *= (found.w + 1.0) / max(found.w, 1.0); // one sample has none
#endif
    out_color = vec4(c, sqrt(variance));
#if HALF
    out_color = round_to_half(out_color);
#endif
    out_moments = m;
}
