// Mean of the variance over 3x3 pixels, beside the colour.

#include "common/finite.glsl"

uniform sampler2D in_color;
uniform sampler2D in_variance;

layout(location = 0) out vec4 out_color;

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy), size = textureSize(in_color, 0);
    float sum = 0.0, count = 0.0;
    for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x) {
            ivec2 q = p + ivec2(x, y);
            if (any(greaterThanEqual(uvec2(q), uvec2(size)))) continue;
            sum += texelFetch(in_variance, q, 0).x;
            count += 1.0;
        }
    vec3 c = texelFetch(in_color, p, 0).rgb;
    out_color = round_to_half(vec4(c, min(sqrt(sum / count), HALF_LIMIT)));
}
