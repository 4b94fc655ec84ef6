// How much of the light has changed, hence how much of the history is void. Schied et al. 2018, sec. 4.4.
//
// WIDEN: 1 takes the largest of 3x3 strata. FOLLOW: 1 also tells by which factor the history is to follow the light.

#include "common/finite.glsl"

uniform sampler2D in_change; // filtered: change of direct light, the larger of now and then; the same for indirect
uniform float u_gain;

layout(location = 0) out vec4 out_lambda;

// A signal that is next to nothing of the light can change by all of it, and nobody sees it.
const float SHARE_FLOOR = 1e-3;
const float LARGEST_FACTOR = 4.0; // beyond it there is little of the new light in the old

vec2 lambda_at(ivec2 q) {
    vec4 c = texelFetch(in_change, q, 0);
    vec2 larger = max(c.yw, SHARE_FLOOR * (c.y + c.w));
    vec2 lambda = min(u_gain * abs(c.xz) / max(larger, vec2(1e-30)), 1.0);
    return vec2(larger.x > 0.0 ? lambda.x : 0.0, larger.y > 0.0 ? lambda.y : 0.0);
}

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
#if WIDEN
    ivec2 size = textureSize(in_change, 0);
    vec2 lambda = vec2(0.0);
    for (int i = 0; i < 9; ++i)
        lambda = max(lambda, lambda_at(clamp(p + ivec2(i % 3, i / 3) - 1, ivec2(0), size - 1)));
#else
    vec2 lambda = lambda_at(p);
#endif
    vec2 factor = vec2(1.0);
#if FOLLOW
    // Of the light now to the light then: what is not the larger of the two is less by the change.
    vec4 c = texelFetch(in_change, p, 0);
    vec2 relative = clamp(c.xz / max(max(c.yw, SHARE_FLOOR * (c.y + c.w)), vec2(1e-30)), -1.0, 1.0);
    factor = mix(1.0 / max(1.0 - relative, vec2(1.0 / LARGEST_FACTOR)), 1.0 + relative, lessThan(relative, vec2(0.0)));
#endif
    out_lambda = round_to_half(vec4(lambda, factor));
}
