// From the sums of the tiles to one exposure, in EV. Reinhard et al. 2002, sec. 3.1, eq. 1 and 2.
//
// THREADS: invocations of the only work group.

#include "common/finite.glsl"

layout(local_size_x = THREADS) in;

uniform sampler2D in_sum; // sum of log2 luminance, number of pixels
uniform sampler2D prev_exposure;
uniform bool u_history_valid;
uniform float u_adaptation;

layout(r32f, binding = 0) writeonly uniform image2D out_exposure;

const float MIDDLE_GREY = 0.18;
const float HIGHEST = 10.0; // EV; what is darker than that is meant to be dark, or noise and nothing else

shared vec2 parts[THREADS];

void main() {
    int thread = int(gl_LocalInvocationID.x);
    ivec2 tiles = textureSize(in_sum, 0);
    vec2 sum = vec2(0.0);
    for (int i = thread; i < tiles.x * tiles.y; i += THREADS)
        sum += texelFetch(in_sum, ivec2(i % tiles.x, i / tiles.x), 0).xy;
    parts[thread] = sum;
    barrier();
    if (thread > 0) return;

    for (int i = 1; i < THREADS; ++i) sum += parts[i];
    float before = texelFetch(prev_exposure, ivec2(0), 0).x;
    bool known = u_history_valid && is_finite(before);
    float exposure = known ? before : 0.0; // a black frame says nothing
    if (sum.y > 0.0) {
        float measured = min(log2(MIDDLE_GREY) - sum.x / sum.y, HIGHEST);
        exposure = known ? mix(before, measured, u_adaptation) : measured;
    }
    imageStore(out_exposure, ivec2(0), vec4(exposure));
}
