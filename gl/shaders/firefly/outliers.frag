// Fireflies cut where they exceed what the neighbours' mean and variance allow. Ray Tracing Gems, ch. 25.

#include "common/finite.glsl"

uniform sampler2D in_color;
uniform float u_deviations;
uniform float u_least_variance;
uniform float u_margin;

layout(location = 0) out vec4 out_color;

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy), size = textureSize(in_color, 0);
    vec4 sampled = texelFetch(in_color, p, 0); // a: where it comes from, handed on
    vec3 c = sampled.rgb;

    // 7x7 without the pixel itself: an outlier would vouch for itself, being at most sqrt(48) deviations from the mean.
    vec3 mean = vec3(0.0), square = vec3(0.0);
    float count = 0.0;
    for (int i = 0; i < 49; ++i) {
        ivec2 q = p + ivec2(i % 7, i / 7) - 3;
        if (i == 24 || any(greaterThanEqual(uvec2(q), uvec2(size)))) continue;
        vec3 n = texelFetch(in_color, q, 0).rgb;
        if (!is_finite(n)) continue;
        n = clamp_radiance(n); // its square is finite
        mean += n;
        square += n * n;
        count += 1.0;
    }
    if (is_finite(c) && count > 0.0) {
        mean /= count;
        vec3 variance = max(square / count - mean * mean, u_least_variance);
        c = min(c, u_margin + mean + u_deviations * sqrt(variance)); // the excess is subtracted
    }
    out_color = vec4(c, sampled.a);
}
