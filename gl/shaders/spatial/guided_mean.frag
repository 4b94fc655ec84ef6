// Guided filter, third and fourth pass: the mean of the functions of all windows that hold a pixel. He et al. 2010, eq. 8.
//
// AXIS: 1 along a row, 2 along a column, which also says what the function gives here. Each function is brought to the
// guide of the pixel it is summed at: constants relative to a common zero would cancel far from the camera.

#include "common/finite.glsl"
#include "common/edges.glsl"
#include "spatial/guide.glsl"

uniform sampler2D in_red; // slopes of the colour's channels with the guide
uniform sampler2D in_green;
uniform sampler2D in_blue;
uniform sampler2D in_color; // what the function says there; a: number of windows
uniform sampler2D in_surface;
#if HAS_IN_SAMPLE
uniform sampler2D in_sample;
#endif
uniform int u_radius;

layout(location = 0) out vec4 out_color;
#if AXIS == 1
layout(location = 1) out vec4 out_red;
layout(location = 2) out vec4 out_green;
layout(location = 3) out vec4 out_blue;
#endif

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy), size = textureSize(in_color, 0), along = ivec2(AXIS == 1, AXIS == 2);
    vec4 middle = guide_at(in_surface, p);
    vec4 red = vec4(0.0), green = vec4(0.0), blue = vec4(0.0), color = vec4(0.0);
    for (int i = -u_radius; i <= u_radius; ++i) {
        ivec2 q = p + i * along;
        if (any(greaterThanEqual(uvec2(q), uvec2(size)))) continue;
        vec4 c = texelFetch(in_color, q, 0);
        if (c.a <= 0.0) continue;
        vec4 r = texelFetch(in_red, q, 0), g = texelFetch(in_green, q, 0), b = texelFetch(in_blue, q, 0);
        vec4 step = middle - guide_at(in_surface, q);
        c.rgb += vec3(dot(r, step), dot(g, step), dot(b, step));
        color += c.a * vec4(c.rgb, 1.0);
        red += c.a * r;
        green += c.a * g;
        blue += c.a * b;
    }
    float share = 1.0 / max(color.a, 1.0);
    color.rgb *= share;
#if AXIS == 1
    out_red = red * share;
    out_green = green * share;
    out_blue = blue * share;
    out_color = color;
#else
    bool there = color.a > 0.0 && is_surface(texelFetch(in_surface, p, 0));
    vec4 own = vec4(texelFetch(in_sample, p, 0).rgb, 0.0);
    out_color = there ? round_to_half(vec4(clamp_radiance(color.rgb), 1.0)) : own;
#endif
}
