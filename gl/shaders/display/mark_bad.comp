// NaN and infinity in red, bright where radiance is bad, dark where a filter has replaced a bad sample; and how many of
// each there are in every tile of TILE x TILE.

#include "common/finite.glsl"

layout(local_size_x = TILE) in;

uniform sampler2D in_color;
uniform sampler2D in_radiance;
#if HAS_IN_DIRECT
uniform sampler2D in_direct;
uniform sampler2D in_indirect;
#endif
#ifdef GLOSSY
uniform sampler2D in_specular;
#endif

layout(rg32ui, binding = 0) writeonly uniform uimage2D out_count;
layout(rgba16f, binding = 1) writeonly uniform image2D out_color;

shared uvec2 columns[TILE];

void main() {
    ivec2 tile = ivec2(gl_WorkGroupID.xy), size = textureSize(in_color, 0);
    int column = int(gl_LocalInvocationID.x);
    ivec2 p = tile * TILE + ivec2(column, 0);
    int end = p.x < size.x ? min(p.y + TILE, size.y) : 0;
    uvec2 count = uvec2(0u);
    for (; p.y < end; ++p.y) {
        vec4 color = texelFetch(in_color, p, 0);
#if HAS_IN_DIRECT
        bool sound = is_finite(texelFetch(in_direct, p, 0).rgb) && is_finite(texelFetch(in_indirect, p, 0).rgb);
#ifdef GLOSSY
        sound = sound && is_finite(texelFetch(in_specular, p, 0).rgb);
#endif
        if (!sound) {
            color = vec4(0.2, 0.0, 0.0, 1.0);
            ++count.x;
        }
#endif
        if (!is_finite(texelFetch(in_radiance, p, 0).rgb)) {
            color = vec4(1.0, 0.0, 0.0, 1.0);
            ++count.y;
        }
        imageStore(out_color, p, color);
    }
    columns[column] = count;
    barrier();
    if (column == 0) {
        for (int i = 1; i < TILE; ++i) count += columns[i];
        imageStore(out_count, tile, uvec4(count, 0u, 0u));
    }
}
