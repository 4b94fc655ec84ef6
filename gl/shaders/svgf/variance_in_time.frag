// Blend the variance found in space with that of the last frame, along the motion vector.
//
// temporal/reproject.frag has found the texels, temporal/accumulate.frag blends colours in the same way.

#include "common/finite.glsl"

uniform sampler2D in_color; // a: standard deviation
uniform sampler2D in_reprojection;
uniform sampler2D prev_variance;
uniform bool u_history_valid;
uniform float u_alpha;

layout(location = 0) out float out_variance;

float sum = 0.0, total = 0.0;

void gather(ivec2 tap, float w) {
    float v = texelFetch(prev_variance, tap, 0).x;
    if (is_finite(v)) {
        sum += w * v;
        total += w;
    }
}

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    float sigma = texelFetch(in_color, p, 0).a;
    vec4 found = texelFetch(in_reprojection, p, 0);
    int mask = u_history_valid ? int(max(found.z, 0.0)) : 0; // below 0 it says why there is none
    ivec2 corner = ivec2(floor(found.xy)), centre = ivec2(floor(found.xy + 0.5));
    vec2 f = found.xy - vec2(corner);
    for (int i = 0; i < 4; ++i) {
        ivec2 d = ivec2(i & 1, i >> 1);
        if ((mask & (1 << i)) != 0) gather(corner + d, (d.x == 1 ? f.x : 1.0 - f.x) * (d.y == 1 ? f.y : 1.0 - f.y));
    }
    int last = mask > 15 ? 8 : -1;
    for (int i = 0; i <= last; ++i)
        if ((mask & (16 << i)) != 0) gather(centre + ivec2(i % 3 - 1, i / 3 - 1), 1.0);
    out_variance = sigma * sigma;
    if (total > 0.0) out_variance = mix(sum / total, out_variance, max(1.0 / (found.w + 1.0), u_alpha));
}
