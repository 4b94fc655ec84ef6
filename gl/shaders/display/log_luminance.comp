// Sum of log2 luminance, and of how many pixels, over tiles of TILE x TILE. Reinhard et al. 2002, sec. 3.1, eq. 1.
//
// One invocation per column and a single barrier: software renderers pay for each barrier in every invocation.

#include "common/color.glsl"
#include "common/finite.glsl"

layout(local_size_x = TILE) in;

uniform sampler2D in_radiance;

layout(rg32f, binding = 0) writeonly uniform image2D out_sum;

const float BLACK = 1.0 / 65536.0; // its logarithm would outweigh everything that can be seen

shared vec2 columns[TILE];

void main() {
    ivec2 tile = ivec2(gl_WorkGroupID.xy), size = textureSize(in_radiance, 0);
    int column = int(gl_LocalInvocationID.x);
    ivec2 p = tile * TILE + ivec2(column, 0);
    int end = p.x < size.x ? min(p.y + TILE, size.y) : 0;
    vec2 sum = vec2(0.0);
    for (; p.y < end; ++p.y) {
        vec3 c = texelFetch(in_radiance, p, 0).rgb;
        float l = is_finite(c) ? luminance(clamp_radiance(c)) : 0.0;
        if (l > BLACK) sum += vec2(log2(l), 1.0);
    }
    columns[column] = sum;
    barrier();
    if (column == 0) {
        for (int i = 1; i < TILE; ++i) sum += columns[i];
        imageStore(out_sum, tile, vec4(sum, 0.0, 0.0));
    }
}
