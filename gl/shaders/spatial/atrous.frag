// One iteration of the edge-avoiding à-trous wavelet, edges set by hand. Dammertz et al. 2010.
//
// STEP: distance of the taps. TAPS: how many of them besides the centre, drawn at random; 0: all 24.

#include "common/color.glsl"
#include "common/finite.glsl"
#include "common/edges.glsl"
#include "common/hash.glsl"

uniform sampler2D in_color;    // rgb, how much of it there is
uniform sampler2D in_surface;  // normal, depth
uniform sampler2D in_gradient; // of depth, per pixel
uniform float u_sigma_z;
uniform float u_sigma_n;
uniform float u_sigma_l;
uniform float u_pixel_size;
uniform uint u_seed;

layout(location = 0) out vec4 out_color;

ivec2 p, size;
vec4 surface, own;
vec2 gradient;
vec3 sum = vec3(0.0);
float weight = 0.0;

void add(ivec2 d, float kernel) {
    ivec2 q = p + d;
    if (any(greaterThanEqual(uvec2(q), uvec2(size)))) return;
    vec4 c = texelFetch(in_color, q, 0);
    vec4 other = texelFetch(in_surface, q, 0);
    // A pixel without a sample has no luminance that others could differ from.
    float off = own.a > 0.0 ? abs(luminance(own.rgb) - luminance(c.rgb)) / u_sigma_l : 0.0;
    float w = surface_weight(surface, other, gradient, vec2(d), u_sigma_z, u_sigma_n, u_pixel_size * surface.w);
    w = sane_weight(kernel * w * exp(-off)) * c.a;
    sum += w * c.rgb;
    weight += w;
}

#if TAPS > 0
// How many of four tossed coins fall on one side, less two, has the distribution of the kernel: 1, 4, 6, 4, 1 of 16.
int toss(uint bits) {
    uint u = bits >> 28;
    return u == 0u ? -2 : u < 5u ? -1 : u < 11u ? 0 : u < 15u ? 1 : 2;
}

// A place in the gap before the next tap.
int jitter(uint bits) { return int((bits >> 12) & uint(STEP - 1)) - STEP / 2; }

// Places of the R2 sequence (Roberts 2018), shifted for each pixel; every other one is turned about, so that the jitter
// has no direction.
void add_taps() {
    uint x = hash(hash(u_seed * 65536u + uint(p.x)) + uint(p.y)), y = hash(x);
    for (int k = 0; k < TAPS; ++k) {
        ivec2 d = ivec2(toss(x), toss(y)) * STEP + ivec2(jitter(x), jitter(y));
        add((k & 1) == 0 ? d : -d, 1.0);
        x += 3242174889u;
        y += 2447445414u;
    }
}
#else
// B3 spline, outer product of (1/16, 1/4, 3/8, 1/4, 1/16), scaled to 1 at the centre.
void add_taps() {
    const float[] KERNEL = float[](1.0, 2.0 / 3.0, 1.0 / 6.0);
    for (int y = -2; y <= 2; ++y)
        for (int x = -2; x <= 2; ++x)
            if (x != 0 || y != 0) add(ivec2(x, y) * STEP, KERNEL[abs(x)] * KERNEL[abs(y)]);
}
#endif

void main() {
    p = ivec2(gl_FragCoord.xy);
    size = textureSize(in_color, 0);
    surface = texelFetch(in_surface, p, 0);
    gradient = texelFetch(in_gradient, p, 0).xy;
    own = texelFetch(in_color, p, 0);
    // Its own sample counts whatever the guides say.
    sum = own.a * own.rgb;
    weight = own.a;
    if (is_surface(surface)) add_taps();
    out_color = weight > 0.0 ? round_to_half(vec4(sum / weight, 1.0)) : vec4(own.rgb, 0.0);
}
