// Joint bilateral filter: near in space and on the same surface, whole or one axis of it.

#include "common/finite.glsl"
#include "common/edges.glsl"
#include "spatial/window.glsl"

uniform sampler2D in_color;    // rgb, how much of it there is
uniform sampler2D in_surface;  // normal, depth
uniform sampler2D in_gradient; // of depth, per pixel
uniform int u_radius;
uniform float u_sigma_d;
uniform float u_sigma_z;
uniform float u_sigma_n;
uniform float u_pixel_size;

void main() {
    ivec2 centre = ivec2(gl_FragCoord.xy);
    vec4 surface = texelFetch(in_surface, centre, 0);
    vec2 gradient = texelFetch(in_gradient, centre, 0).xy;
    begin_window(textureSize(in_color, 0), u_radius, is_surface(surface));
    for (int y = -reach.y; y <= reach.y; ++y)
        for (int x = -reach.x; x <= reach.x; ++x) {
            ivec2 d = ivec2(x, y);
            float w = gaussian(d, u_sigma_d);
            possible += w;
            if (!inside(p + d)) continue;
            vec4 other = texelFetch(in_surface, p + d, 0);
            // Its own sample counts whatever the guides say.
            if (d != ivec2(0))
                w *= surface_weight(
                    surface, other, gradient, vec2(d), u_sigma_z, u_sigma_n, u_pixel_size * surface.w
                );
            add(texelFetch(in_color, p + d, 0), sane_weight(w));
        }
    write_mean(texelFetch(in_color, p, 0).rgb);
}
