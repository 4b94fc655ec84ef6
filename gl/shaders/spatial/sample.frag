// What the filters in space see of a frame: the sum of its signals, and where there is any.
//
// in_albedo is connected where the filter is to see the surfaces' albedo as well.

#include "common/color.glsl"
#include "common/finite.glsl"
#include "common/edges.glsl"

uniform sampler2D in_direct;
#if HAS_IN_INDIRECT
uniform sampler2D in_indirect;
#endif
uniform sampler2D in_surface; // normal, depth
#if HAS_IN_ALBEDO
uniform sampler2D in_albedo;
#endif

layout(location = 0) out vec4 out_color;

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    vec3 c = texelFetch(in_direct, p, 0).rgb;
#if HAS_IN_INDIRECT
    c += texelFetch(in_indirect, p, 0).rgb;
#endif
#if HAS_IN_ALBEDO
    c *= texelFetch(in_albedo, p, 0).rgb;
#endif
    bool there = is_surface(texelFetch(in_surface, p, 0));
    // A sample on no surface, or on one whose guides are not finite, takes no part, but it is not lost.
    out_color = is_finite(c) ? round_to_half(vec4(clamp_radiance(c), there ? 1.0 : 0.0)) : vec4(0.0);
}
