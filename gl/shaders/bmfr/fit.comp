// Fit every block of the noisy picture by noise-free features. Koskela et al. 2019, feature fitting.
//
// One work group per block of GROUP_X x GROUP_Y pixels. X_AT: place of feature X's first component in a row; what is not
// in the list of features is neither computed nor read. NOISE: stochastic regularisation. UNIT: scale to [0, 1]. PARTS: of
// the block, PART pixels wide, that are fitted again; not defined if there are none. FRESH: of fewer frames a part is judged
// by another caution; not defined if of none.

layout(local_size_x = THREADS) in;

#include "common/finite.glsl"
#include "common/hash.glsl"
#include "bmfr/solver.glsl"
#include "bmfr/parts.glsl"

uniform sampler2D in_color;   // rgb: accumulated irradiance, finite; a: samples in it, 0: none
uniform sampler2D in_surface; // normal, depth
#if HAS_IN_ALBEDO
uniform sampler2D in_albedo;
#endif
#ifdef ROUGHNESS_AT
uniform sampler2D in_roughness;
#endif
uniform mat3 u_view;   // from pixels at depth 1, depth to world space
uniform vec2 u_jitter; // of the camera rays, pixels
uniform ivec2 u_offset;
uniform uint u_seed;
uniform float u_noise;
uniform float u_rank_tolerance;
uniform float u_caution;
uniform float u_fresh_caution;

layout(rgba16f, binding = 0) writeonly uniform image2D out_color;

#define HAS_POSITION (W_AT + W2_AT + W3_AT + DEPTH_AT > -4)

const int PIXELS = GROUP_X * GROUP_Y;

// What the invocations share out among them: the block's parts, or the block as a single piece.
#if PARTS
const ivec2 PIECE = ivec2(PART);
#else
const ivec2 PIECE = ivec2(GROUP_X, GROUP_Y);
#endif
const int PIECES = max(PARTS, 1);
const int PIECE_PIXELS = PIECE.x * PIECE.y;
const int SHARING = max(THREADS / PIECES, 1); // invocations that work on the same piece

shared vec4 s_low[THREADS], s_high[THREADS];

ivec2 size;
ivec2 corner; // of the block
vec4 origin, scale;
vec3 middle_normal, middle_albedo;
float middle_roughness;

ivec2 pixel_of(int element) { return corner + ivec2(element % GROUP_X, element / GROUP_X); }

// Element of the block that is the `i`-th of a piece.
int element_of(int piece, int i) {
    const int across = GROUP_X / PIECE.x;
    ivec2 at = ivec2(piece % across, piece / across) * PIECE + ivec2(i % PIECE.x, i / PIECE.x);
    return at.y * GROUP_X + at.x;
}

// The picture goes on as its mirror image. The clamp is for pictures smaller than a block.
ivec2 mirrored(ivec2 p) {
    p = max(p, -p - 1);
    p = min(p, 2 * size - 1 - p);
    return clamp(p, ivec2(0), size - 1);
}

// xyz: position, world axes; w: depth. Relative to the camera, where single precision is exact to a few roundings of the
// distance wherever in the world that is: nothing but differences inside of a block counts.
vec4 place_of(ivec2 p, vec4 surface) {
    vec2 at = vec2(p) + 0.5 + u_jitter - 0.5 * vec2(size);
    return vec4(surface.w * (u_view * vec3(at, 1.0)), surface.w);
}

bool is_surface(vec4 surface, vec4 place) { return surface.w > 0.0 && is_finite(surface) && is_finite(place); }

// Origin and scale that bring every position of the block to [-1, 1], before it is squared: far from the origin of the
// world squares would be as good as linear.
void scale_to_block(int thread) {
    vec4 low = vec4(3e38), high = vec4(-3e38);
    for (int i = thread; i < PIXELS; i += THREADS) {
        ivec2 p = mirrored(pixel_of(i));
        vec4 surface = texelFetch(in_surface, p, 0);
        vec4 place = place_of(p, surface);
        bool counts = is_surface(surface, place);
        low = counts ? min(low, place) : low;
        high = counts ? max(high, place) : high;
    }
    s_low[thread] = low;
    s_high[thread] = high;
    barrier();
    for (int i = 0; i < THREADS; ++i) {
        low = min(low, s_low[i]);
        high = max(high, s_high[i]);
    }
    // What is much thinner than the block is wide, or than it is far away, is scaled less: a wall would otherwise be blown
    // up to a relief of rounding errors. The last floor is for a block of no extent at all.
    vec4 span = max(high - low, 0.0);
    float widest = max(span.x, max(span.y, span.z));
    span = max(span, max(max(widest / 8.0, high.w / 1024.0), 1e-30));
#if UNIT
    origin = low;
    scale = 1.0 / span;
#else
    origin = 0.5 * (low + high);
    scale = 2.0 / span;
#endif
}

// The features of a pixel into the beginning of `row`.
void write_features(ivec2 p, vec4 surface, vec4 place) {
    vec4 w = (place - origin) * scale;
    row[0] = 1.0;
#if N_AT >= 0
    vec3 n = surface.xyz - middle_normal;
    row[N_AT] = n.x, row[N_AT + 1] = n.y, row[N_AT + 2] = n.z;
#endif
#if W_AT >= 0
    row[W_AT] = w.x, row[W_AT + 1] = w.y, row[W_AT + 2] = w.z;
#endif
#if W2_AT >= 0
    row[W2_AT] = w.x * w.x, row[W2_AT + 1] = w.y * w.y, row[W2_AT + 2] = w.z * w.z;
#endif
#if W3_AT >= 0
    row[W3_AT] = w.x * w.x * w.x, row[W3_AT + 1] = w.y * w.y * w.y, row[W3_AT + 2] = w.z * w.z * w.z;
#endif
#if DEPTH_AT >= 0
    row[DEPTH_AT] = w.w;
#endif
#if ALBEDO_AT >= 0
    vec3 albedo = texelFetch(in_albedo, p, 0).rgb;
    albedo = is_finite(albedo) ? albedo - middle_albedo : vec3(0.0);
    row[ALBEDO_AT] = albedo.r, row[ALBEDO_AT + 1] = albedo.g, row[ALBEDO_AT + 2] = albedo.b;
#endif
#ifdef ROUGHNESS_AT
    float roughness = texelFetch(in_roughness, p, 0).a;
    row[ROUGHNESS_AT] = is_finite(vec3(roughness)) ? roughness - middle_roughness : 0.0;
#endif
}

uint state; // of the noise

// Uniform noise in [-u_noise, u_noise) for every feature but the constant.
void add_noise(const int k) {
    state = state * 1664525u + 1013904223u;
    row[k] += k == 0 ? 0.0 : u_noise / 8388608.0 * (float(state >> 8) - 8388608.0);
}
#define ADD_NOISE(k) add_noise(k);

#define SELECT(k) row[k] = counts ? row[k] : 0.0;

void fold_pixel(int element, uint seed) {
    ivec2 p = mirrored(pixel_of(element));
    vec4 surface = texelFetch(in_surface, p, 0);
    vec4 color = texelFetch(in_color, p, 0);
    vec4 place = place_of(p, surface);
    write_features(p, surface, place);
    row[FEATURES] = color.r, row[FEATURES + 1] = color.g, row[FEATURES + 2] = color.b;
#if NOISE
    state = hash(seed + uint(element));
    EACH(ADD_NOISE)
#endif
    // Select, do not multiply: a row of zeros changes nothing, 0 · NaN would change everything.
    bool counts = is_surface(surface, place) && color.a > 0.0;
    EACH(SELECT)
    for (int k = FEATURES; k < COLUMNS; ++k) row[k] = counts ? row[k] : 0.0;
#ifdef FRESH
    age += counts ? color.a : 0.0;
#endif
    fold_row();
}

// Each part has a triangle of its own, which it leaves in shared memory; those of an invocation's parts are folded
// together for the block's. Where several invocations share a part, merge_triangles() comes past its triangle.
void fold_block(int thread) {
    uint block = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint seed = hash(u_seed) + block * uint(PIXELS);
    for (int piece = thread % PIECES; piece < PIECES; piece += THREADS) {
        clear_triangle();
        for (int i = thread / PIECES; i < PIECE_PIXELS; i += SHARING) fold_pixel(element_of(piece, i), seed);
#if THREADS <= PARTS
        share_triangle(LANES + piece);
#endif
    }
#if THREADS < PARTS
    for (int piece = thread; piece < PARTS - THREADS; piece += THREADS) fold_triangle(LANES + piece, FEATURES);
#endif
}

#define LOAD_WEIGHT(k) piece_weights[k] = s_weights[first + k];
#define ADD_FEATURE(k) fit += row[k] * piece_weights[k];

void write_piece(int piece, int start) {
    int first = PARTS > 0 ? FEATURES * (1 + piece) : 0;
    vec3 piece_weights[FEATURES];
    EACH(LOAD_WEIGHT)
    for (int i = start; i < PIECE_PIXELS; i += SHARING) {
        ivec2 p = pixel_of(element_of(piece, i));
        bool inside = all(lessThan(uvec2(p), uvec2(size)));
        vec4 surface = texelFetch(in_surface, mirrored(p), 0);
        vec4 color = texelFetch(in_color, mirrored(p), 0);
        vec4 place = place_of(p, surface);
        write_features(mirrored(p), surface, place);
        vec3 fit = vec3(0.0);
        EACH(ADD_FEATURE)
        fit = is_finite(fit) ? clamp_radiance(fit) : color.rgb;
        fit = is_surface(surface, place) ? fit : color.rgb; // 0 on a miss; where a guide is NaN, no hole
        if (inside) imageStore(out_color, p, round_to_half(vec4(fit, 1.0)));
    }
}

void main() {
    int thread = int(gl_LocalInvocationID.x);
    size = textureSize(in_color, 0);
    corner = ivec2(gl_WorkGroupID.xy) * ivec2(GROUP_X, GROUP_Y) - ivec2(GROUP_X, GROUP_Y) / 2 + u_offset;
    origin = scale = vec4(0.0);
#if HAS_POSITION
    scale_to_block(thread);
#endif
    // Bounded features are taken relative to one pixel's, so that a constant one becomes a column of zeros, which costs
    // the rank test nothing.
    ivec2 middle = mirrored(corner + ivec2(GROUP_X, GROUP_Y) / 2);
    vec3 normal = texelFetch(in_surface, middle, 0).xyz;
    middle_normal = is_finite(normal) ? normal : vec3(0.0);
#if ALBEDO_AT >= 0
    vec3 albedo = texelFetch(in_albedo, middle, 0).rgb;
    middle_albedo = is_finite(albedo) ? albedo : vec3(0.0);
#endif
#ifdef ROUGHNESS_AT
    float roughness = texelFetch(in_roughness, middle, 0).a;
    middle_roughness = is_finite(vec3(roughness)) ? roughness : 0.0;
#endif
    fold_block(thread);
    merge_triangles(thread);
    if (thread == 0) solve(u_rank_tolerance);
    barrier();
#if PARTS
    for (int part = thread; part < PARTS; part += THREADS) solve_part(part, u_rank_tolerance, u_caution, u_fresh_caution);
    barrier();
#endif
    for (int piece = thread % PIECES; piece < PIECES; piece += THREADS) write_piece(piece, thread / PIECES);
}
