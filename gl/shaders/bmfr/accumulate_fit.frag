// Blend the fitted picture with those of the frames before. Koskela et al. 2019, postprocessing.
//
// The texels to blend with are those that bmfr/accumulate.frag has accepted. ADAPTIVE: as there.

#include "common/finite.glsl"

uniform sampler2D in_color;        // the fit
uniform sampler2D in_reprojection; // place in the last frame, mask of valid taps, history length
#ifdef ADAPTIVE
uniform sampler2D in_lambda; // z: factor by which the light has changed
#endif
uniform sampler2D prev_color;      // as out_color
uniform bool u_history_valid;
uniform float u_alpha;

layout(location = 0) out vec4 out_color;

vec3 color = vec3(0.0);
float total = 0.0;

void gather(ivec2 tap, float w) {
    vec3 c = texelFetch(prev_color, tap, 0).rgb;
    if (is_finite(c)) {
        color += w * c;
        total += w;
    }
}

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    vec3 c = texelFetch(in_color, p, 0).rgb;
    vec4 found = texelFetch(in_reprojection, p, 0);
    int mask = u_history_valid ? int(found.z) : 0;
    ivec2 corner = ivec2(floor(found.xy));
    vec2 f = found.xy - vec2(corner);
    if (mask != 0) {
        if ((mask & 1) != 0) gather(corner, (1.0 - f.x) * (1.0 - f.y));
        if ((mask & 2) != 0) gather(corner + ivec2(1, 0), f.x * (1.0 - f.y));
        if ((mask & 4) != 0) gather(corner + ivec2(0, 1), (1.0 - f.x) * f.y);
        if ((mask & 8) != 0) gather(corner + ivec2(1, 1), f.x * f.y);
    }
    // The plain mean at first: an exponential one would let the first fits, the worst, outweigh the next twenty.
    if (total > 0.0) {
        color /= total;
#ifdef ADAPTIVE
        color = clamp_radiance(color * texelFetch(in_lambda, p, 0).z); // the history's length has been cut already
#endif
        c = mix(color, c, max(1.0 / (found.w + 1.0), u_alpha));
    }
    out_color = round_to_half(vec4(c, 1.0));
}
