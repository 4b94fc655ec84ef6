// Fireflies cut at a fixed radiance. Ray Tracing Gems, ch. 17.

#include "common/finite.glsl"

uniform sampler2D in_color;
uniform float u_max_radiance;

layout(location = 0) out vec4 out_color;

void main() {
    vec4 sampled = texelFetch(in_color, ivec2(gl_FragCoord.xy), 0); // a: where it comes from, handed on
    vec3 c = sampled.rgb;
    // Infinity is no bright sample but a broken one: it stays, so that accumulation can leave it out.
    out_color = vec4(is_finite(c) ? min(c, u_max_radiance) : c, sampled.a);
}
