// Guided filter, second of four passes: the window's statistics from its rows', and the colour as a linear function of
// the guide. He et al. 2010, eq. 5 and 6; rows are put together as by Chan et al. 1979.

#include "common/finite.glsl"
#include "common/edges.glsl"
#include "spatial/guide.glsl"

uniform sampler2D in_color;   // mean of the row; a: number of samples
uniform sampler2D in_guide;   // mean of the row, relative to its middle pixel's
uniform sampler2D in_variance;
uniform sampler2D in_across;
uniform sampler2D in_depth;
uniform sampler2D in_red;
uniform sampler2D in_green;
uniform sampler2D in_blue;
uniform sampler2D in_surface; // normal, depth
uniform int u_radius;
uniform float u_epsilon;
uniform float u_pixel_size;

layout(location = 0) out vec4 out_red; // slopes of the colour's channels with the guide
layout(location = 1) out vec4 out_green;
layout(location = 2) out vec4 out_blue;
layout(location = 3) out vec4 out_color; // what the function says here; a: 1, or 0: there is none

ivec2 p;
vec4 middle;
vec3 own;
float count = 0.0;
vec3 colors = vec3(0.0);
vec4 guides = vec4(0.0), red = vec4(0.0), green = vec4(0.0), blue = vec4(0.0);
mat4 covariance = mat4(0.0);

void add_row(ivec2 q) {
    vec4 row = texelFetch(in_color, q, 0);
    float n = row.a;
    if (n <= 0.0) return;
    vec4 g = guide_at(in_surface, q) - middle + texelFetch(in_guide, q, 0);
    vec3 c = row.rgb - own;
    vec4 v = texelFetch(in_variance, q, 0), a = texelFetch(in_across, q, 0);
    vec2 d = texelFetch(in_depth, q, 0).xy;
    count += n;
    colors += n * c;
    guides += n * g;
    covariance += n * (mat4(v.x, a.xyz, a.x, v.y, a.w, d.x, a.yw, v.z, d.y, a.z, d, v.w) + outerProduct(g, g));
    red += n * (texelFetch(in_red, q, 0) + g * c.r);
    green += n * (texelFetch(in_green, q, 0) + g * c.g);
    blue += n * (texelFetch(in_blue, q, 0) + g * c.b);
}

// Solves m x = b for symmetric m with a diagonal of at least epsilon beyond what makes it singular (Cholesky).
mat4 factor(mat4 m) {
    for (int j = 0; j < 4; ++j) {
        for (int k = 0; k < j; ++k) m[j][j] -= m[j][k] * m[j][k];
        m[j][j] = sqrt(max(m[j][j], u_epsilon * 1e-3));
        for (int i = j + 1; i < 4; ++i) {
            for (int k = 0; k < j; ++k) m[i][j] -= m[i][k] * m[j][k];
            m[i][j] /= m[j][j];
        }
    }
    return m; // m[i][j], j <= i: row i of the lower triangle
}

vec4 solve(mat4 l, vec4 b) {
    for (int i = 0; i < 4; ++i) {
        for (int k = 0; k < i; ++k) b[i] -= l[i][k] * b[k];
        b[i] /= l[i][i];
    }
    for (int i = 3; i >= 0; --i) {
        for (int k = i + 1; k < 4; ++k) b[i] -= l[k][i] * b[k];
        b[i] /= l[i][i];
    }
    return b;
}

void main() {
    p = ivec2(gl_FragCoord.xy);
    int height = textureSize(in_color, 0).y;
    bool there = is_surface(texelFetch(in_surface, p, 0));
    middle = guide_at(in_surface, p);
    own = texelFetch(in_color, p, 0).rgb;
    int last = there ? min(p.y + u_radius, height - 1) : -1;
    for (int y = max(p.y - u_radius, 0); y <= last; ++y) add_row(ivec2(p.x, y));
    out_red = out_green = out_blue = out_color = vec4(0.0);
    if (count <= 0.0) return;
    vec4 g = guides / count;
    vec3 c = colors / count;
    // Depth counts in widths of the window, so that nothing depends on the scene's unit.
    vec4 scale = vec4(1.0, 1.0, 1.0, 1.0 / max(u_pixel_size * middle.w * float(u_radius), 1e-30));
    mat4 m = matrixCompMult(covariance / count - outerProduct(g, g), outerProduct(scale, scale));
    mat4 l = factor(m + mat4(u_epsilon));
    out_red = solve(l, (red / count - g * c.r) * scale) * scale;
    out_green = solve(l, (green / count - g * c.g) * scale) * scale;
    out_blue = solve(l, (blue / count - g * c.b) * scale) * scale;
    out_color = vec4(own + c - vec3(dot(out_red, g), dot(out_green, g), dot(out_blue, g)), 1.0);
}
