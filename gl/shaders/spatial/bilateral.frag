// Bilateral filter: near in space and near in colour. Tomasi and Manduchi 1998.

#define AXIS 0

#include "common/finite.glsl"
#include "common/edges.glsl"
#include "spatial/window.glsl"

uniform sampler2D in_color;   // rgb, how much of it there is
uniform sampler2D in_surface; // normal, depth
uniform int u_radius;
uniform float u_sigma_d;
uniform float u_sigma_r;

void main() {
    ivec2 centre = ivec2(gl_FragCoord.xy);
    begin_window(textureSize(in_color, 0), u_radius, is_surface(texelFetch(in_surface, centre, 0)));
    vec4 own = texelFetch(in_color, centre, 0);
    // A pixel without a sample has no colour that others could differ from.
    float scale = own.a > 0.0 ? 1.0 / u_sigma_r : 0.0;
    for (int y = -reach.y; y <= reach.y; ++y)
        for (int x = -reach.x; x <= reach.x; ++x) {
            ivec2 d = ivec2(x, y);
            if (!inside(p + d)) continue;
            vec4 c = texelFetch(in_color, p + d, 0);
            vec3 off = (c.rgb - own.rgb) * scale;
            add(c, gaussian(d, u_sigma_d) * exp(-0.5 * dot(off, off)));
        }
    write_mean(own.rgb);
}
