// Exposure and tone curve: linear radiance to linear display light.

#include "common/color.glsl"
#include "common/finite.glsl"

uniform sampler2D in_radiance;
uniform float u_scale;

layout(location = 0) out vec4 out_color;

void main() {
    vec3 c = texelFetch(in_radiance, ivec2(gl_FragCoord.xy), 0).rgb;
    c = is_finite(c) ? clamp_radiance(c * u_scale) : vec3(0.0);
#if OPERATOR == 1
    c = tonemap_reinhard(c);
#elif OPERATOR == 2
    c = tonemap_aces(c);
#endif
    out_color = vec4(c, 1.0);
}
