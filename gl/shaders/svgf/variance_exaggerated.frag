// A hundred times the variance over time, and 100 without a history: what some code does, to compare with.

#include "common/finite.glsl"

uniform sampler2D in_color;        // a: standard deviation over time
uniform sampler2D in_reprojection; // w: history length before this frame

layout(location = 0) out vec4 out_color;

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    vec4 c = texelFetch(in_color, p, 0);
    c.a = texelFetch(in_reprojection, p, 0).w > 0.0 ? min(10.0 * c.a, HALF_LIMIT) : 10.0;
    out_color = round_to_half(c);
}
