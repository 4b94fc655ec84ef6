// Gaussian blur, whole or one axis of it.

#include "common/finite.glsl"
#include "common/edges.glsl"
#include "spatial/window.glsl"

uniform sampler2D in_color;   // rgb, how much of it there is
uniform sampler2D in_surface; // normal, depth
#if HAS_IN_SAMPLE
uniform sampler2D in_sample;
#endif
uniform int u_radius;
uniform float u_sigma_d;

void main() {
    // Rows are blurred where there is no surface, too: columns beside it need them.
    bool surface = is_surface(texelFetch(in_surface, ivec2(gl_FragCoord.xy), 0));
    begin_window(textureSize(in_color, 0), u_radius, surface || AXIS == 1);
    for (int y = -reach.y; y <= reach.y; ++y)
        for (int x = -reach.x; x <= reach.x; ++x) {
            ivec2 d = ivec2(x, y);
            float w = gaussian(d, u_sigma_d);
            possible += w;
            if (inside(p + d)) add(texelFetch(in_color, p + d, 0), w);
        }
#if HAS_IN_SAMPLE
    write_mean(texelFetch(in_sample, p, 0).rgb);
#else
    write_mean(texelFetch(in_color, p, 0).rgb);
#endif
}
