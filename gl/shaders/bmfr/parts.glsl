// Parts of a block, each fitted again around the block's fit as far as its own samples bear that out.
//
// The triangles of the parts are those that the block's is made of, so that no pixel is read again. A part's least
// squares, taken of what the block's weights leave of its colours, add to the fit that light which no polynomial
// expresses over the whole block. They also add noise, the more the fewer samples there are. How much of the addition
// is light is what the F statistic tells, and by that it is shrunk, as a whole and in the manner of James and Stein 1961,
// "Estimation with Quadratic Loss": the limit of an addition that means nothing is the block's own fit.

#if PARTS

vec3 weights[FEATURES];
float gain; // squares of the colours that the part's own weights explain and the block's do not
float used; // features in it

void load_row(const int k, int slot) {
    for (int j = k; j < COLUMNS; ++j) triangle[entry(k, j)] = s_triangle[entry(k, j) * SLOTS + slot];
}

vec3 color_of(const int k) {
    return vec3(triangle[entry(k, FEATURES)], triangle[entry(k, FEATURES + 1)], triangle[entry(k, FEATURES + 2)]);
}

// Leave of the colours in row k what the block's weights do not explain.
void subtract_block(const int k) {
    vec3 color = color_of(k);
    for (int j = k; j < FEATURES; ++j) color -= triangle[entry(k, j)] * weights[j];
    triangle[entry(k, FEATURES)] = color.r;
    triangle[entry(k, FEATURES + 1)] = color.g;
    triangle[entry(k, FEATURES + 2)] = color.b;
}

void count_row(const int k) {
    vec3 color = color_of(k);
    bool kept = triangle[entry(k, k)] > 0.0;
    float square = dot(color, color);
    gain += kept ? square : 0.0;
    rest += kept ? 0.0 : square;
    used += kept ? 1.0 : 0.0;
}

void substitute(const int k) {
    vec3 color = color_of(k);
    for (int j = k + 1; j < FEATURES; ++j) color -= triangle[entry(k, j)] * weights[j];
    float diagonal = triangle[entry(k, k)];
    weights[k] = diagonal > 0.0 ? color / diagonal : vec3(0.0);
}

#define LOAD(k) load_row(k, slot);
#define LOAD_BLOCK(k) weights[k] = s_weights[k];
#define SUBTRACT(k) subtract_block(k);
#define COUNT(k) count_row(k);
#define SUBSTITUTE(k) substitute(FEATURES - 1 - (k));
#define STORE(k) s_weights[first + k] = s_weights[k] + (share > 0.0 ? share * weights[k] : vec3(0.0));

// Weights of a part, in s_weights behind the block's and those of the parts before; by one invocation after solve().
// `caution`: 1 expects of noise to explain its variance in each feature; neighbouring samples that share a history, and
// are alike for that reason, explain more. `fresh`: the caution where the samples are means of fewer than FRESH frames.
void solve_part(int part, float tolerance, float caution, float fresh) {
    int slot = LANES + part, first = FEATURES * (1 + part);
    EACH(LOAD)
    EACH(LOAD_BLOCK)
    EACH(SUBTRACT) // before columns are dropped, of which the block's weights are not 0
    rest = s_rest[slot];
#ifdef FRESH
    age = s_age[slot];
#endif
#if !NOISE // which leaves no column that depends on others
    share_triangle(slot);
    drop_dependent(slot, tolerance);
    EACH(LOAD)
#endif
    gain = used = 0.0;
    EACH(COUNT)
    float samples = floor(triangle[entry(0, 0)] * triangle[entry(0, 0)] + 0.5); // feature 0 is the constant
#ifdef FRESH
    caution = age < float(FRESH) * samples ? fresh : caution;
#endif
    float freedom = samples - used;
    bool enough = freedom > used && gain > 0.0;
    float share = enough ? max(1.0 - caution * used * rest / (freedom * gain), 0.0) : 0.0;
    EACH(SUBSTITUTE)
    EACH(STORE)
}

#endif
