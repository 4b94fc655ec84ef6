// Temporal anti-aliasing. Karis 2014, "High Quality Temporal Supersampling".

#include "common/color.glsl"
#include "common/finite.glsl"

uniform sampler2D in_color; // tone-mapped, linear; a = 0: none, the radiance was NaN or infinite
uniform sampler2D in_motion;
uniform sampler2D in_surface;
uniform sampler2D prev_color; // as out_color; a = 0: none yet
uniform bool u_history_valid;
uniform float u_alpha;

layout(location = 0) out vec4 out_color;

ivec2 size;

// Catmull-Rom spline through the history: bilinear filtering would blur it a little more every frame.
vec3 history_at(vec2 lattice) {
    vec2 base = floor(lattice);
    vec2 f = lattice - base;
    vec2 w[4];
    w[0] = f * (-0.5 + f * (1.0 - 0.5 * f));
    w[1] = 1.0 + f * f * (-2.5 + 1.5 * f);
    w[2] = f * (0.5 + f * (2.0 - 1.5 * f));
    w[3] = f * f * (-0.5 + 0.5 * f);
    vec3 sum = vec3(0.0);
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 4; ++x) {
            ivec2 q = clamp(ivec2(base) + ivec2(x - 1, y - 1), ivec2(0), size - 1);
            sum += w[x].x * w[y].y * texelFetch(prev_color, q, 0).rgb;
        }
    return sum;
}

// Where the way from the box's mean to the history leaves the box.
vec3 clip_to_box(vec3 history, vec3 mean, vec3 low, vec3 high) {
    vec3 d = history - mean;
    vec3 room = mix(mean - low, high - mean, vec3(greaterThan(d, vec3(0.0))));
    // Flat neighbourhood: 0 / 0. The floor makes that 1, a history equal to the mean.
    vec3 t = (room + 1e-7) / (abs(d) + 1e-7);
    return mean + d * min(1.0, min(t.x, min(t.y, t.z)));
}

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    size = textureSize(in_color, 0);
    vec4 fresh = texelFetch(in_color, p, 0);
    vec3 c = fresh.rgb;
    out_color = fresh;
    if (!u_history_valid) return;

    // Colour box of the 3x3 neighbourhood in YCoCg.
    vec3 centre = to_ycocg(c), low = centre, high = centre, mean = vec3(0.0);
    for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x) {
            vec3 n = to_ycocg(texelFetch(in_color, clamp(p + ivec2(x, y), ivec2(0), size - 1), 0).rgb);
            low = min(low, n);
            high = max(high, n);
            mean += n / 9.0;
        }
    // Motion of the nearest surface among the four diagonal neighbours and the pixel: a moving edge then takes its
    // anti-aliased rim along. A depth of 0 is the sky, the farthest.
    ivec2 nearest = p;
    float depth = texelFetch(in_surface, p, 0).w;
    depth = depth > 0.0 ? depth : 1e30;
    for (int i = 0; i < 4; ++i) {
        ivec2 q = clamp(p + ivec2((i & 1) * 2 - 1, (i >> 1) * 2 - 1), ivec2(0), size - 1);
        float z = texelFetch(in_surface, q, 0).w;
        if (z > 0.0 && z < depth) {
            depth = z;
            nearest = q;
        }
    }
    vec2 lattice = vec2(p) + texelFetch(in_motion, nearest, 0).xy * vec2(size);
    bool known = all(greaterThanEqual(lattice, vec2(-0.5))) && all(lessThan(lattice, vec2(size) - 0.5)) &&
                 texelFetch(prev_color, ivec2(floor(lattice + 0.5)), 0).a > 0.0;
    vec3 history = known ? history_at(lattice) : c;
    history = is_finite(history) ? clamp_radiance(history) : c; // the spline rings below zero and above its values
    if (fresh.a == 0.0) { // black would stay in the history for many frames
        out_color = round_to_half(vec4(history, known ? 1.0 : 0.0));
        return;
    }
#if CLIP
    history = max(from_ycocg(clip_to_box(to_ycocg(history), mean, low, high)), vec3(0.0));
#endif
    // Weights that fall with luminance keep one bright sample from flickering through the mean.
    float new_weight = u_alpha / (1.0 + luminance(c));
    float old_weight = (1.0 - u_alpha) / (1.0 + luminance(history));
    c = (new_weight * c + old_weight * history) / (new_weight + old_weight);
    out_color = round_to_half(vec4(c, 1.0));
}
