// Variance in space where the history is too short for one in time. Schied et al. 2017, sec. 4.2.
//
// GLOSSY: specular light, of surfaces of like roughness. PREFILTER: the colour there is replaced by its mean in space,
// too; that of specular light over no more pixels than its lobe is wide.
// CENTRED: the second moment is that about the mean. SAMPLE: everywhere, of this frame's samples.

#include "common/color.glsl"
#include "common/finite.glsl"

uniform sampler2D in_color;   // rgb, standard deviation over time
#if HAS_IN_MOMENTS
uniform sampler2D in_moments; // first and second luminance moment
uniform sampler2D in_reprojection; // w: history length before this frame
#endif
#ifdef SAMPLE
uniform sampler2D in_sample;
#if HAS_IN_REPROJECTION
uniform sampler2D in_reprojection; // asked for by PREFILTER
#endif
#endif
uniform sampler2D in_surface;
#ifdef GLOSSY
uniform sampler2D in_specular_albedo; // a: roughness
uniform float u_sigma_r;
uniform float u_reach;
#endif
uniform sampler2D in_gradient;
uniform float u_sigma_z;
uniform float u_pixel_size;

layout(location = 0) out vec4 out_color;

const float MIN_HISTORY = 4.0;

float origin = 0.0; // what moments are relative to, so that the difference of large ones need not be taken

#if HAS_IN_MOMENTS
float history_at(ivec2 q) { return texelFetch(in_reprojection, q, 0).w + 1.0; }
vec4 color_at(ivec2 q) { return texelFetch(in_color, q, 0); }
#ifdef CENTRED
float origin_at(ivec2 q) { return texelFetch(in_moments, q, 0).x; }
vec2 moments_at(ivec2 q) {
    vec2 m = texelFetch(in_moments, q, 0).xy;
    m.x -= origin;
    return vec2(m.x, m.y + m.x * m.x);
}
#else
float origin_at(ivec2 q) { return 0.0; }
vec2 moments_at(ivec2 q) { return texelFetch(in_moments, q, 0).xy; }
#endif
#else
// Alpha below 0: there is no sample.
vec4 usable(vec3 c) { return is_finite(c) ? vec4(clamp_radiance(c), 0.0) : vec4(vec3(0.0), -1.0); }
#ifdef SAMPLE
vec4 color_at(ivec2 q) { return vec4(texelFetch(in_color, q, 0).rgb, 0.0); }
vec4 sample_at(ivec2 q) { return usable(texelFetch(in_sample, q, 0).rgb); }
float history_at(ivec2 q) { return MIN_HISTORY; }
#else
vec4 color_at(ivec2 q) { return usable(texelFetch(in_color, q, 0).rgb); }
vec4 sample_at(ivec2 q) { return color_at(q); }
float history_at(ivec2 q) { return 1.0; }
#endif
float origin_at(ivec2 q) { return luminance(sample_at(q).rgb); }
vec2 moments_at(ivec2 q) {
    float l = origin_at(q) - origin;
    return vec2(l, l * l);
}
#endif

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    vec4 color = color_at(p);
    vec4 surface = texelFetch(in_surface, p, 0);
    float h = history_at(p);
    origin = origin_at(p);

    // 7x7 bilateral window over the moments. The loop is empty, not masked, where the history is long enough: a
    // software rasteriser runs both sides of a branch.
#if HAS_IN_MOMENTS
    bool wanted = h < MIN_HISTORY;
#else
    bool wanted = true;
#endif
    int last = wanted && surface.w > 0.0 ? 48 : -1;
    vec3 sum = vec3(0.0);
    vec4 colors = vec4(0.0); // a: weight
    ivec2 size = textureSize(in_color, 0);
    vec2 gradient = texelFetch(in_gradient, p, 0).xy;
    float floor_z = 0.1 * u_pixel_size * surface.w;
#ifdef GLOSSY
    float roughness = texelFetch(in_specular_albedo, p, 0).a;
    float inverse_reach = 1.0 / (u_reach * roughness * roughness + 0.1);
#endif
    for (int i = 0; i <= last; ++i) {
        ivec2 d = ivec2(i % 7, i / 7) - 3;
        ivec2 q = p + d;
        if (any(greaterThanEqual(uvec2(q), uvec2(size)))) continue;
        vec4 s = texelFetch(in_surface, q, 0);
        float n = max(dot(surface.xyz, s.xyz), 0.0);
        n *= n; n *= n; n *= n; n *= n; n *= n; n *= n; n *= n; // ^128
        float range = u_sigma_z * abs(dot(gradient, vec2(d))) + floor_z * length(vec2(d)) + 1e-30;
        float e = abs(surface.w - s.w) / range;
#ifdef GLOSSY
        vec4 gloss = texelFetch(in_specular_albedo, q, 0);
        e += abs(roughness - gloss.a) / u_sigma_r;
        e = gloss.r + gloss.g + gloss.b > 0.0 ? e : 1e30; // where nothing shines there is no light to tell of
#endif
        float w = sane_weight(n * exp(-e));
#if !HAS_IN_MOMENTS
        w = sample_at(q).a < 0.0 ? 0.0 : w;
#endif
        sum += w * vec3(moments_at(q), 1.0);
#ifdef GLOSSY
        w *= exp(-length(vec2(d)) * inverse_reach); // a variance may be that of a wider field, a reflection may not
#endif
        colors += w * vec4(color_at(q).rgb, 1.0);
    }
    if (last >= 0 && sum.z > 0.0 && colors.a > 0.0) {
        vec2 m = sum.xy / sum.z;
        // Few frames make a poor estimate, and a low one freezes the noise: exaggerate while the history is short.
        float variance = max(m.y - m.x * m.x, 0.0) * MIN_HISTORY / h;
        color.a = min(sqrt(variance), HALF_LIMIT);
#if defined(PREFILTER) && defined(SAMPLE)
        if (texelFetch(in_reprojection, p, 0).w + 1.0 < MIN_HISTORY) color.rgb = colors.rgb / colors.a;
#elif defined(PREFILTER)
        color.rgb = colors.rgb / colors.a;
#elif !HAS_IN_MOMENTS && !defined(SAMPLE)
        if (color_at(p).a < 0.0) color.rgb = colors.rgb / colors.a; // without time there is nothing else to take
#endif
    }
    color.a = max(color.a, 0.0);
    out_color = round_to_half(color);
}
