// Exposure and tone curve: linear radiance to linear display light.
//
// OPERATOR: 0 none, 1 Reinhard, 2 ACES. MEASURED: there is a measured exposure as well.

#include "common/color.glsl"
#include "common/finite.glsl"

uniform sampler2D in_radiance;
#ifdef MEASURED
uniform sampler2D in_exposure; // EV, one texel
#endif
uniform float u_scale;

layout(location = 0) out vec4 out_color;

void main() {
    vec3 c = texelFetch(in_radiance, ivec2(gl_FragCoord.xy), 0).rgb;
    float scale = u_scale;
#ifdef MEASURED
    scale *= exp2(texelFetch(in_exposure, ivec2(0), 0).x);
#endif
    bool usable = is_finite(c);
    c = usable ? clamp_radiance(c * scale) : vec3(0.0);
#if OPERATOR == 1
    c = tonemap_reinhard(c);
#elif OPERATOR == 2
    c = tonemap_aces(c);
#endif
    out_color = vec4(c, usable ? 1.0 : 0.0);
}
