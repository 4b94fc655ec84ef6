// The mean over a window around a pixel, d(p) = Σ w c / Σ w. Samples count by their alpha, 0 where there is none.
//
// AXIS: 0 the whole square, 1 its row, 2 its column.

layout(location = 0) out vec4 out_color; // rgb: mean; a: 1, 0 without any sample; of a row how much of it there was

ivec2 p, size, reach; // reach: half the window's sides
vec3 sum = vec3(0.0);
float weight = 0.0, possible = 0.0;

// The loops over the window are empty, not masked, where there is nothing to filter: a software rasteriser runs both
// sides of a branch.
void begin_window(ivec2 image, int radius, bool wanted) {
    p = ivec2(gl_FragCoord.xy);
    size = image;
    reach = (AXIS == 1 ? ivec2(1, 0) : AXIS == 2 ? ivec2(0, 1) : ivec2(1)) * radius;
    if (!wanted) reach = ivec2(-1);
}

bool inside(ivec2 q) { return all(lessThan(uvec2(q), uvec2(size))); }

float gaussian(ivec2 d, float sigma) { return exp(-0.5 * dot(vec2(d), vec2(d)) / (sigma * sigma)); }

void add(vec4 c, float w) {
    sum += w * c.a * c.rgb;
    weight += w * c.a;
}

// Of the row's mean the column counts as much as there was of the row: two passes are exactly the whole square where
// weights are products, whatever pixels have no sample. A pixel without any in its window stays as it is.
void write_mean(vec3 own) {
    vec4 mean = vec4(sum / weight, AXIS == 1 ? weight / possible : 1.0);
    out_color = weight > 0.0 ? round_to_half(mean) : vec4(own, 0.0);
}
