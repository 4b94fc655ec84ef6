// Guided filter, first of four passes: mean and covariances of guide and colour along a piece of a row.
//
// He et al. 2010, eq. 5 and 6; Bauszat et al. 2011. All is relative to the middle pixel's guide and colour, or squares
// of depths and radiances would drown the differences.

#include "common/finite.glsl"
#include "spatial/guide.glsl"

uniform sampler2D in_color;   // rgb, 1 or 0: there is none
uniform sampler2D in_surface; // normal, depth
uniform int u_radius;

layout(location = 0) out vec4 out_guide; // mean, relative to this pixel's
layout(location = 1) out vec4 out_color; // mean; a: number of samples
layout(location = 2) out vec4 out_variance;
layout(location = 3) out vec4 out_across; // xy xz xw yz
layout(location = 4) out vec2 out_depth;  // yw zw
layout(location = 5) out vec4 out_red;    // covariance of the guide with the colour's channels
layout(location = 6) out vec4 out_green;
layout(location = 7) out vec4 out_blue;

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    int width = textureSize(in_color, 0).x;
    vec4 middle = guide_at(in_surface, p);
    vec3 own = texelFetch(in_color, p, 0).rgb;
    float count = 0.0;
    vec3 colors = vec3(0.0);
    vec4 guides = vec4(0.0), variance = vec4(0.0), across = vec4(0.0), red = vec4(0.0), green = vec4(0.0);
    vec4 blue = vec4(0.0);
    vec2 depth = vec2(0.0);
    for (int x = max(p.x - u_radius, 0); x <= min(p.x + u_radius, width - 1); ++x) {
        ivec2 q = ivec2(x, p.y);
        vec4 c = texelFetch(in_color, q, 0);
        if (c.a <= 0.0) continue;
        c.rgb -= own;
        vec4 g = texelFetch(in_surface, q, 0) - middle;
        count += 1.0;
        colors += c.rgb;
        guides += g;
        variance += g * g;
        across += g.xxxy * g.yzwz;
        depth += g.yz * g.w;
        red += g * c.r;
        green += g * c.g;
        blue += g * c.b;
    }
    float share = 1.0 / max(count, 1.0);
    vec4 g = guides * share;
    vec3 c = colors * share;
    out_guide = g;
    out_color = vec4(c + own, count);
    out_variance = variance * share - g * g;
    out_across = across * share - g.xxxy * g.yzwz;
    out_depth = depth * share - g.yz * g.w;
    out_red = red * share - g * c.r;
    out_green = green * share - g * c.g;
    out_blue = blue * share - g * c.b;
}
