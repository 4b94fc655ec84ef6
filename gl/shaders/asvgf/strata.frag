// What each stratum of 3x3 pixels shows: the surface that its gradient belongs to, and the light on it.
// Schied et al. 2018, sec. 4.3: the guides of the gradients' reconstruction.
//
// LIGHT: 1 writes mean and variance of the light as well. JOINT: 1 where direct and indirect are one signal. Without
// in_indirect there is one signal only.

#include "common/color.glsl"
#include "common/finite.glsl"

uniform sampler2D in_direct; // a: 0 where a sample was carried over from the last frame
#if HAS_IN_INDIRECT
uniform sampler2D in_indirect;
#endif
uniform sampler2D in_surface;
uniform sampler2D in_gradient;

layout(location = 0) out vec4 out_surface;
layout(location = 1) out vec4 out_slope;
layout(location = 2) out vec4 out_light;

const int SIDE = 3;

void main() {
    ivec2 corner = SIDE * ivec2(gl_FragCoord.xy), size = textureSize(in_surface, 0);
    // Without a carried sample the centre speaks for the stratum, which the image's border may have cut.
    ivec2 speaker = min(corner + 1, size - 1);
    vec2 sum = vec2(0.0), squares = vec2(0.0);
    float count = 0.0;
    for (int i = 0; i < SIDE * SIDE; ++i) {
        ivec2 p = corner + ivec2(i % SIDE, i / SIDE);
        if (any(greaterThanEqual(p, size))) continue;
        vec4 direct = texelFetch(in_direct, p, 0);
        if (direct.a == 0.0) speaker = p;
#if LIGHT
#if HAS_IN_INDIRECT
        vec3 indirect = texelFetch(in_indirect, p, 0).rgb;
#else
        vec3 indirect = vec3(0.0);
#endif
        if (!is_finite(direct.rgb) || !is_finite(indirect)) continue;
        vec2 l = vec2(luminance(clamp_radiance(direct.rgb)), luminance(clamp_radiance(indirect)));
#if JOINT
        l = vec2(l.x + l.y, 0.0);
#endif
        sum += l;
        squares += l * l;
        count += 1.0;
#endif
    }
    out_surface = texelFetch(in_surface, speaker, 0);
    out_slope = vec4(texelFetch(in_gradient, speaker, 0).xy, 0.0, 0.0);
    vec2 mean = sum / max(count, 1.0), variance = max(squares / max(count, 1.0) - mean * mean, 0.0);
    out_light = vec4(mean.x, variance.x, mean.y, variance.y);
}
