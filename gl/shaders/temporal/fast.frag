// A second, short history: the mean of the last few frames, exponential, without moments.
//
// Its texels are those that a pass before has accepted: bits 0 to 3 of the mask are the 2x2 around the place in the last
// frame, bits 4 to 12 the 3x3.

#include "common/finite.glsl"

uniform sampler2D in_color;
#if HAS_IN_SECOND
uniform sampler2D in_second;
#endif
uniform sampler2D in_reprojection; // place in the last frame, mask of valid taps, history length
uniform sampler2D prev_color;      // as out_color
uniform bool u_history_valid;
uniform float u_frames;

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
#if HAS_IN_SECOND
    c += texelFetch(in_second, p, 0).rgb;
#endif
    bool usable = is_finite(c);
    c = usable ? clamp_radiance(c) : vec3(0.0);
    vec4 found = texelFetch(in_reprojection, p, 0);
    int mask = u_history_valid ? int(max(found.z, 0.0)) : 0;
    ivec2 corner = ivec2(floor(found.xy));
    vec2 f = found.xy - vec2(corner);
    for (int i = 0; i < 4; ++i) {
        ivec2 d = ivec2(i & 1, i >> 1);
        if ((mask & (1 << i)) != 0)
            gather(corner + d, (d.x == 1 ? f.x : 1.0 - f.x) * (d.y == 1 ? f.y : 1.0 - f.y));
    }
    ivec2 centre = ivec2(floor(found.xy + 0.5));
    int last = mask > 15 ? 8 : -1;
    for (int i = 0; i <= last; ++i)
        if ((mask & (16 << i)) != 0) gather(centre + ivec2(i % 3 - 1, i / 3 - 1), 1.0);
    if (total > 0.0) c = mix(color / total, c, usable ? 1.0 / min(found.w + 1.0, u_frames) : 0.0);
    out_color = round_to_half(vec4(c, 1.0));
}
