// Give back what the features cannot express: narrow shadows, rims darker than their surroundings. Not in the paper.
//
// The mean difference of samples and fit tends to the fit's error, one path's noise divided by the frames. It is added
// where it stands out of that noise, shrunk by it.

#include "common/color.glsl"
#include "common/finite.glsl"

uniform sampler2D in_color;  // the accumulated fit
uniform sampler2D in_direct;
uniform sampler2D in_indirect;
uniform sampler2D in_reprojection; // place in the last frame, mask of valid taps, history length
uniform sampler2D prev_residual;   // as out_residual
uniform bool u_history_valid;
uniform float u_alpha;
uniform float u_deviations;

layout(location = 0) out vec4 out_color;
layout(location = 1) out vec4 out_residual; // rgb: mean difference; a: root of the mean squared luminance of one

vec4 residual = vec4(0.0); // a: squared
float total = 0.0;

void gather(ivec2 tap, float w) {
    vec4 r = texelFetch(prev_residual, tap, 0);
    if (is_finite(r)) {
        residual += w * vec4(r.rgb, r.a * r.a);
        total += w;
    }
}

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    vec3 c = texelFetch(in_color, p, 0).rgb;
    vec3 sampled = texelFetch(in_direct, p, 0).rgb + texelFetch(in_indirect, p, 0).rgb;
    bool usable = is_finite(sampled);
    vec3 difference = usable ? clamp_radiance(sampled) - c : vec3(0.0);
    float l = luminance(difference);

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
    float share = total > 0.0 ? max(1.0 / (found.w + 1.0), u_alpha) : 1.0;
    residual = mix(total > 0.0 ? residual / total : vec4(0.0), vec4(difference, l * l), share);
    // Variance of a mean with such shares; a mean of few says nothing of its noise.
    float mean = luminance(residual.rgb);
    float variance = max(residual.a - mean * mean, 0.0) * max(share, u_alpha) ;
    float noise = u_deviations * u_deviations * variance;
    float part = found.w < 3.0 ? 0.0 : max(1.0 - noise / max(mean * mean, 1e-20), 0.0);
    out_color = round_to_half(vec4(max(c + part * residual.rgb, 0.0), 1.0));
    out_residual = round_to_half(vec4(residual.rgb, min(sqrt(residual.a), HALF_LIMIT)));
}
