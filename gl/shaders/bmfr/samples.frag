// This frame's samples as bmfr/accumulate.frag would hand them on without a history.

#include "common/finite.glsl"

uniform sampler2D in_direct;
#if HAS_IN_INDIRECT
uniform sampler2D in_indirect;
#endif
uniform sampler2D in_surface; // normal, depth

layout(location = 0) out vec4 out_color; // rgb, samples in it

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    vec3 c = texelFetch(in_direct, p, 0).rgb;
#if HAS_IN_INDIRECT
    c += texelFetch(in_indirect, p, 0).rgb;
#endif
    bool usable = is_finite(c);
    c = usable ? clamp_radiance(c) : vec3(0.0);
    out_color = round_to_half(vec4(c, usable && texelFetch(in_surface, p, 0).w > 0.0 ? 1.0 : 0.0));
}
