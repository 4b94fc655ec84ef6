// Blend a colour with its history found by temporal/reproject.frag: C' = a·C + (1 - a)·C'_prev, nothing else.
//
// Schied et al. 2017, sec. 4.1. temporal/accumulate.frag also has the moments of luminance. RAW: in_color is a sample that
// no pass has looked at yet, and its alpha says nothing. CLAMPED: as there.

#include "common/finite.glsl"

uniform sampler2D in_color; // a: 0 where there is none
uniform sampler2D in_reprojection;
uniform sampler2D prev_color; // as out_color
#ifdef CLAMPED
uniform sampler2D in_low;
uniform sampler2D in_high;
#endif
uniform bool u_history_valid;
uniform float u_alpha;

layout(location = 0) out vec4 out_color;

vec3 color = vec3(0.0);
float total = 0.0;

void gather(ivec2 tap, float w) {
    vec4 c = texelFetch(prev_color, tap, 0);
#ifdef RAW
    c.a = 1.0; // whatever feeds the history keeps there
#endif
    // Select, do not multiply: 0 · NaN is NaN, and a NaN in a recursive filter stays for ever.
    if (is_finite(c) && c.a > 0.0) {
        color += w * c.rgb;
        total += w;
    }
}

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    vec4 c = texelFetch(in_color, p, 0);
#ifdef RAW
    c = is_finite(c.rgb) ? vec4(clamp_radiance(c.rgb), 1.0) : vec4(0.0);
#endif
    vec4 found = texelFetch(in_reprojection, p, 0);
    int mask = u_history_valid ? int(max(found.z, 0.0)) : 0; // below 0 it says why there is none
    ivec2 corner = ivec2(floor(found.xy));
    vec2 f = found.xy - vec2(corner);
    for (int i = 0; i < 4; ++i) {
        ivec2 d = ivec2(i & 1, i >> 1);
        if ((mask & (1 << i)) != 0) gather(corner + d, (d.x == 1 ? f.x : 1.0 - f.x) * (d.y == 1 ? f.y : 1.0 - f.y));
    }
    ivec2 centre = ivec2(floor(found.xy + 0.5));
    int last = mask > 15 ? 8 : -1;
    for (int i = 0; i <= last; ++i)
        if ((mask & (16 << i)) != 0) gather(centre + ivec2(i % 3 - 1, i / 3 - 1), 1.0);
    if (total > 0.0) {
        color /= total;
#ifdef CLAMPED
        color = clamp(color, texelFetch(in_low, p, 0).rgb, texelFetch(in_high, p, 0).rgb);
#endif
        // A plain running mean until the new one's share has fallen to alpha, exponential from then on.
        c = vec4(c.a > 0.0 ? mix(color, c.rgb, max(1.0 / (found.w + 1.0), u_alpha)) : color, 1.0);
    }
    out_color = round_to_half(c);
}
