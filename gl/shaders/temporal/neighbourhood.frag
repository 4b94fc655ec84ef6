// Bounds of the colours that this frame shows around a pixel: mean ± u_sigma standard deviations, per channel.
// Salvi 2016, "An Excursion in Temporal Supersampling".
//
// RADIUS: of the window, in pixels.

#include "common/finite.glsl"

uniform sampler2D in_color;
uniform float u_sigma;

layout(location = 0) out vec4 out_low;
layout(location = 1) out vec4 out_high;

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy), size = textureSize(in_color, 0);
    vec3 mean = vec3(0.0), square = vec3(0.0);
    float count = 0.0;
    for (int y = -RADIUS; y <= RADIUS; ++y)
        for (int x = -RADIUS; x <= RADIUS; ++x) {
            ivec2 q = p + ivec2(x, y);
            if (any(greaterThanEqual(uvec2(q), uvec2(size)))) continue;
            vec3 c = texelFetch(in_color, q, 0).rgb;
            if (!is_finite(c)) continue;
            c = clamp_radiance(c);
            mean += c;
            square += c * c;
            count += 1.0;
        }
    // No sample at all, no bound.
    out_low = vec4(0.0);
    out_high = vec4(HALF_LIMIT);
    if (count > 0.0) {
        mean /= count;
        vec3 reach = u_sigma * sqrt(max(square / count - mean * mean, 0.0));
        out_low = round_to_half(vec4(mean - reach, 0.0));
        out_high = round_to_half(vec4(mean + reach, 0.0)); // perhaps infinity, which is a bound like any other
    }
}
