// Blend this frame's sample with the history of the same surface. Koskela et al. 2019, preprocessing.
//
// Reprojection and blending in one: both read the same texels. bmfr/accumulate_fit.frag blends by the same decisions.
// ADAPTIVE: where light has changed, the history follows it and counts for less (Schied et al. 2018). IN_PLACE: the point is
// looked for where it is now, as if only the camera had moved.

#include "common/finite.glsl"
#include "common/octahedral.glsl"

uniform sampler2D in_direct;
#if HAS_IN_INDIRECT
uniform sampler2D in_indirect;
#endif
uniform sampler2D in_motion;  // uv offset, expected previous depth, object id
uniform sampler2D in_surface; // normal, depth
#if HAS_IN_PREV_NORMAL
uniform sampler2D in_prev_normal;
#endif
#ifdef ADAPTIVE
uniform sampler2D in_lambda; // x: how much of the history is void; z: factor by which the light has changed
#endif
uniform sampler2D prev_color; // as out_color
uniform sampler2D prev_guide; // as out_guide
uniform bool u_history_valid;
uniform mat3 u_view;
uniform float u_pixel_size;
uniform float u_alpha;
uniform float u_max_history;
uniform float u_position_tolerance;
uniform float u_normal_tolerance;
#ifdef IN_PLACE
uniform mat3 u_turn;
uniform vec3 u_step;
#endif

layout(location = 0) out vec4 out_color;        // rgb, samples in it
layout(location = 1) out vec4 out_reprojection; // place in the last frame, mask of valid taps, history length
layout(location = 2) out vec2 out_guide;        // normal, depth

const float MIN_COSINE = 0.05;

ivec2 size;

// Where a texel of the last frame, or a place between them, was in that frame's view space at `depth`.
vec3 view_position(vec2 texel, float depth) {
    return vec3((texel + 0.5 - 0.5 * vec2(size)) * (u_pixel_size * depth), depth);
}

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    size = textureSize(in_motion, 0);
    vec3 c = texelFetch(in_direct, p, 0).rgb;
#if HAS_IN_INDIRECT
    c += texelFetch(in_indirect, p, 0).rgb;
#endif
    bool usable = is_finite(c);
    c = usable ? clamp_radiance(c) : vec3(0.0);
    vec4 motion = texelFetch(in_motion, p, 0);
    vec4 surface = texelFetch(in_surface, p, 0);
#if HAS_IN_PREV_NORMAL
    vec3 normal = texelFetch(in_prev_normal, p, 0).xyz;
#else
    vec3 normal = surface.xyz;
#endif
    bool hit = motion.w >= 0.0;

    vec2 lattice = vec2(p) + motion.xy * vec2(size);
#ifdef IN_PLACE
    vec3 now = u_turn * view_position(vec2(p), surface.w) + u_step;
    motion.z = now.z;
    lattice = now.xy / (u_pixel_size * now.z) + 0.5 * vec2(size) - 0.5;
#endif
    bool seen = u_history_valid && hit && is_finite(motion) && is_finite(surface) && is_finite(normal) &&
                motion.z > 0.0 && all(greaterThan(lattice, vec2(-1.0))) && all(lessThan(lattice, vec2(size)));
    vec3 color = vec3(0.0);
    float total = 0.0, lengths = 0.0, mask = 0.0;
    if (seen) {
        // A pixel's width on the surface, along its slope: neighbouring texels of one surface are not farther apart.
        vec3 ray = u_view * vec3(vec2(p) + 0.5 - 0.5 * vec2(size), 1.0);
        float cosine = max(abs(dot(normalize(ray), surface.xyz)), MIN_COSINE);
        float limit = u_position_tolerance * u_pixel_size * motion.z / cosine;
        vec3 expected = view_position(lattice, motion.z);
        ivec2 corner = ivec2(floor(lattice));
        vec2 f = lattice - vec2(corner);
        for (int i = 0; i < 4; ++i) {
            ivec2 d = ivec2(i & 1, i >> 1);
            ivec2 tap = corner + d;
            float w = (d.x == 1 ? f.x : 1.0 - f.x) * (d.y == 1 ? f.y : 1.0 - f.y);
            bool inside = all(lessThan(uvec2(tap), uvec2(size)));
            vec2 guide = texelFetch(prev_guide, clamp(tap, ivec2(0), size - 1), 0).xy;
            vec4 before = texelFetch(prev_color, clamp(tap, ivec2(0), size - 1), 0);
            vec3 moved = view_position(vec2(tap), guide.y) - expected;
            vec3 turned = decode_normal(guide.x) - normal;
            bool same = dot(moved, moved) <= limit * limit && dot(turned, turned) <= u_normal_tolerance;
            if (inside && same && w > 1e-4 && before.a > 0.0 && is_finite(before)) {
                mask += float(1 << i);
                total += w;
                color += w * before.rgb;
                lengths += w * before.a;
            }
        }
    }
    float history = 0.0;
    if (total > 0.0) {
        history = min(lengths / total, u_max_history - 1.0);
#if ROUND_HISTORY
        history = floor(history + 0.5);
#endif
        float share = max(1.0 / (history + 1.0), u_alpha);
        color /= total;
#ifdef ADAPTIVE
        vec4 change = texelFetch(in_lambda, p, 0);
        float void_share = clamp(change.x, 0.0, 1.0);
        color = clamp_radiance(color * change.z);
        share = mix(share, 1.0, void_share);
        history = max((history + 1.0) / (1.0 + void_share * history) - 1.0, 0.0);
#endif
        c = mix(color, c, usable ? share : 0.0);
    }
    float count = hit ? history + (usable ? 1.0 : 0.0) : 0.0;
    out_color = round_to_half(vec4(c, floor(count + 0.5)));
    out_reprojection = vec4(lattice, mask, history);
    out_guide = vec2(encode_normal(surface.xyz), surface.w);
}
