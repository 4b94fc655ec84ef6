// One iteration of the edge-avoiding à-trous wavelet. Dammertz et al. 2010; Schied et al. 2017, sec. 4.3 and 4.4.
//
// STEP: distance of the taps. SIGMA_N_SQUARINGS: log2 of the normal exponent, or -1 where it is no power of two.
// LUMINANCE_STOP: 0 leaves out w_l. RAW: in_color is a sample that no pass has looked at yet.
// GLOSSY: specular light, of surfaces of like roughness. GROWING: the normals' exponent grows with the history.
// The taps are written out, so that constants fold.

#include "common/color.glsl"
#include "common/finite.glsl"

uniform sampler2D in_color;   // rgb irradiance, standard deviation of its luminance
uniform sampler2D in_surface; // normal, depth
uniform sampler2D in_gradient;
#if HAS_IN_REPROJECTION
uniform sampler2D in_reprojection; // w: history length before this frame
#endif
#ifdef GLOSSY
uniform sampler2D in_specular_albedo; // a: roughness
uniform float u_sigma_r;
uniform float u_reach;
#endif
#ifdef GROWING
uniform sampler2D in_length; // w: history length before this frame
uniform float u_normal_history;
float exponent;
#endif
uniform float u_accumulated_variance;
uniform float u_sigma_z;
uniform float u_sigma_n;
uniform float u_sigma_l;
uniform float u_pixel_size;

layout(location = 0) out vec4 out_color;

const float LOG2_E = 1.44269504;

ivec2 p, size;
vec4 surface;
vec2 gradient;
float l, inverse_l, floor_z;
vec3 color;
float weight, variance;
#ifdef GLOSSY
float roughness, inverse_r, inverse_reach;
#endif

vec4 color_at(ivec2 q) {
    vec4 c = texelFetch(in_color, q, 0);
#if RAW
    // Below 0: there is no sample.
    c = is_finite(c.rgb) ? vec4(clamp_radiance(c.rgb), 0.0) : vec4(vec3(0.0), -1.0);
#endif
    return c;
}

#ifndef GROWING
float normal_weight(vec3 n) {
    float w = max(dot(surface.xyz, n), 0.0);
#if SIGMA_N_SQUARINGS >= 0
    for (int i = 0; i < SIGMA_N_SQUARINGS; ++i) w *= w;
#else
    w = pow(w, u_sigma_n);
#endif
    return w;
}
#endif

void tap(ivec2 offset, float kernel, float inverse_z) {
    ivec2 q = p + offset;
    bool inside = all(lessThan(uvec2(q), uvec2(size)));
    q = clamp(q, ivec2(0), size - 1);
    vec4 c = color_at(q);
    vec4 s = texelFetch(in_surface, q, 0);
    float e = abs(surface.w - s.w) * inverse_z;
#if LUMINANCE_STOP
    e += abs(l - luminance(c.rgb)) * inverse_l;
#endif
#ifdef GLOSSY
    vec4 gloss = texelFetch(in_specular_albedo, q, 0);
    e += abs(roughness - gloss.a) * inverse_r + length(vec2(offset)) * inverse_reach;
#endif
#ifdef GROWING
    // A power of the cosine, in the exponential that is there anyway. Of 0 there is no logarithm.
    e -= exponent * log2(max(dot(surface.xyz, s.xyz), 1e-30));
    float w = kernel * exp2(-e);
#else
    float w = kernel * normal_weight(s.xyz) * exp2(-e);
#endif
#ifdef GLOSSY
    w = gloss.r + gloss.g + gloss.b > 0.0 ? w : 0.0; // where nothing shines there is no light to tell of
#endif
    w = inside ? sane_weight(w) : 0.0;
#if RAW
    w = c.a < 0.0 ? 0.0 : w;
#endif
    color += w * c.rgb;
    variance += (w * c.a) * (w * c.a);
    weight += w;
}

// Two opposite taps share the denominator of w_z. Its floor is a tenth of a pixel's width: on a plane that faces the
// camera the gradient is 0, and rounding of the depth must not cut the surface in pieces.
void pair(int dx, int dy, float kernel) {
    ivec2 offset = ivec2(dx, dy) * STEP;
    vec2 d = vec2(offset);
    float inverse_z = LOG2_E / (u_sigma_z * abs(dot(gradient, d)) + floor_z * length(d) + 1e-30);
    tap(offset, kernel, inverse_z);
    tap(-offset, kernel, inverse_z);
}

void main() {
    p = ivec2(gl_FragCoord.xy);
    size = textureSize(in_color, 0);
    vec4 centre = color_at(p);
    surface = texelFetch(in_surface, p, 0);
    gradient = texelFetch(in_gradient, p, 0).xy;
    floor_z = 0.1 * u_pixel_size * surface.w;
    l = luminance(centre.rgb);
#ifdef GROWING
    float length_now = texelFetch(in_length, p, 0).w + 1.0;
    exponent = max(u_sigma_n * min(length_now / u_normal_history, 1.0), 1.0);
#endif
#ifdef GLOSSY
    roughness = texelFetch(in_specular_albedo, p, 0).a;
    inverse_r = LOG2_E / u_sigma_r;
    inverse_reach = LOG2_E / (u_reach * roughness * roughness + 0.1);
#endif

#if LUMINANCE_STOP
    // Variance blurred by a 3x3 Gaussian, for w_l only: a single estimate is too noisy to steer by.
    float blurred = 0.0;
    for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x) {
            float sigma = color_at(clamp(p + ivec2(x, y), ivec2(0), size - 1)).a;
            blurred += sigma * sigma * (x == 0 ? 0.5 : 0.25) * (y == 0 ? 0.5 : 0.25);
        }
    inverse_l = LOG2_E / (u_sigma_l * sqrt(blurred) + 1e-6);
#endif

    // B3 spline, outer product of (1/16, 1/4, 3/8, 1/4, 1/16), scaled to 1 at the centre, whose weight is never 0.
    const float A = 2.0 / 3.0, B = 1.0 / 6.0;
    color = centre.rgb;
    variance = centre.a * centre.a;
    weight = 1.0;
#if RAW
    // What is around a missing sample decides, if there is anything.
    if (centre.a < 0.0) weight = 1e-20, variance = 0.0;
#endif
    pair(1, 0, A);      pair(0, 1, A);
    pair(1, 1, A * A);  pair(1, -1, A * A);
    pair(2, 0, B);      pair(0, 2, B);
    pair(2, 1, A * B);  pair(2, -1, A * B);
    pair(1, 2, A * B);  pair(1, -2, A * B);
    pair(2, 2, B * B);  pair(2, -2, B * B);

#if HAS_IN_REPROJECTION
    // From here on the variance is that of the accumulated colour: 1/h of one sample's while the mean is a plain one.
    float h = texelFetch(in_reprojection, p, 0).w + 1.0;
    variance *= max(1.0 / h, u_accumulated_variance);
#endif
    // Var = Σ w² var / (Σ w)²: the standard deviation is what half precision can hold.
    out_color = round_to_half(vec4(color / weight, min(sqrt(variance) / weight, HALF_LIMIT)));
}
