// Bring a long history within what a short one shows around the pixel: its mean ± u_sigma standard deviations.
//
// RADIUS: of the window, in pixels.

#include "common/finite.glsl"

uniform sampler2D in_color; // rgb is clamped, a is left alone
uniform sampler2D in_fast;
uniform float u_sigma;

layout(location = 0) out vec4 out_color;

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy), size = textureSize(in_color, 0);
    vec3 mean = vec3(0.0), square = vec3(0.0);
    float count = 0.0;
    for (int y = -RADIUS; y <= RADIUS; ++y)
        for (int x = -RADIUS; x <= RADIUS; ++x) {
            ivec2 q = p + ivec2(x, y);
            if (any(greaterThanEqual(uvec2(q), uvec2(size)))) continue;
            vec3 c = texelFetch(in_fast, q, 0).rgb;
            mean += c;
            square += c * c;
            count += 1.0;
        }
    mean /= count; // the pixel itself is always there
    vec3 reach = u_sigma * sqrt(max(square / count - mean * mean, 0.0));
    vec4 c = texelFetch(in_color, p, 0);
    out_color = round_to_half(vec4(clamp(c.rgb, max(mean - reach, 0.0), mean + reach), c.a));
}
