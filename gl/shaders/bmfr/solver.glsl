// Linear least squares by Givens rotations, for FEATURES features and the three channels of a colour.
//
// Every invocation folds rows (features, colour) into an upper triangle of its own; the group's triangles are then merged
// through shared memory, and one invocation solves. Nothing but the triangle is kept: Koskela et al. 2019
// leave out Q in the same way. A rotation cannot cancel, so no sign has to be chosen as for Householder reflections.
//
// The triangle must stay in registers. Compilers see to that only where every index is constant, and they do not unroll
// a loop of this size by themselves: hence EACH. FEATURES is at most 18, THREADS a power of two. PARTS: triangles of parts of
// the block that stay in shared memory besides, with what bmfr/parts.glsl needs to know of them; 0 or a power of two.

#ifndef PARTS
#define PARTS 0
#endif

const int COLUMNS = FEATURES + 3;
const int ENTRIES = FEATURES * (FEATURES + 7) / 2;
const int LANES = max(THREADS / 2, 1);
const int SLOTS = LANES + PARTS; // triangles in shared memory: first those to be merged, then the parts'

#define EACH_1(F) F(0)
#define EACH_2(F) EACH_1(F) F(1)
#define EACH_3(F) EACH_2(F) F(2)
#define EACH_4(F) EACH_3(F) F(3)
#define EACH_5(F) EACH_4(F) F(4)
#define EACH_6(F) EACH_5(F) F(5)
#define EACH_7(F) EACH_6(F) F(6)
#define EACH_8(F) EACH_7(F) F(7)
#define EACH_9(F) EACH_8(F) F(8)
#define EACH_10(F) EACH_9(F) F(9)
#define EACH_11(F) EACH_10(F) F(10)
#define EACH_12(F) EACH_11(F) F(11)
#define EACH_13(F) EACH_12(F) F(12)
#define EACH_14(F) EACH_13(F) F(13)
#define EACH_15(F) EACH_14(F) F(14)
#define EACH_16(F) EACH_15(F) F(15)
#define EACH_17(F) EACH_16(F) F(16)
#define EACH_18(F) EACH_17(F) F(17)
#define EACH_(N) EACH_##N
#define EACH_OF(N) EACH_(N)
#define EACH(F) EACH_OF(FEATURES)(F) // F(0) F(1) ... F(FEATURES - 1)

// Row k of the triangle from its diagonal to the colours, rows one after the other.
int entry(int k, int j) { return k * COLUMNS - k * (k - 1) / 2 + j - k; }

float triangle[ENTRIES];
float row[COLUMNS];

shared float s_triangle[ENTRIES * SLOTS];
shared vec3 s_weights[FEATURES * (1 + PARTS)]; // first the block's
#if PARTS
float rest; // squares of the colours, summed up, that no weights can explain in the rows of `triangle`
shared float s_rest[SLOTS];
float age = 0.0; // frames in the samples, summed up; of use with FRESH only
#ifdef FRESH
shared float s_age[SLOTS];
#endif
#endif

void clear_row(const int k) {
    for (int j = k; j < COLUMNS; ++j) triangle[entry(k, j)] = 0.0;
}

#define CLEAR(k) clear_row(k);
void clear_triangle() {
    EACH(CLEAR)
#if PARTS
    rest = age = 0.0;
#endif
}

// Turn `row` against row k of the triangle so that its element k becomes 0.
void rotate(const int k) {
    float a = triangle[entry(k, k)], b = row[k];
    float square = a * a + b * b;
    // Features are of the order of 1. Where both are 0 the row passes on as it is, and row k is left for another one.
    bool turn = square > 1e-20;
    float inverse = turn ? inversesqrt(square) : 0.0;
    float c = turn ? a * inverse : 1.0, s = b * inverse;
    triangle[entry(k, k)] = square * inverse;
    for (int j = k + 1; j < COLUMNS; ++j) {
        float t = triangle[entry(k, j)];
        triangle[entry(k, j)] = c * t + s * row[j];
        row[j] = c * row[j] - s * t;
    }
}

#define ROTATE(k) rotate(k);
void fold_row() {
    EACH(ROTATE)
#if PARTS
    for (int k = FEATURES; k < COLUMNS; ++k) rest += row[k] * row[k];
#endif
}

void share_row(const int k, int slot) {
    for (int j = k; j < COLUMNS; ++j) s_triangle[entry(k, j) * SLOTS + slot] = triangle[entry(k, j)];
}

#define SHARE(k) share_row(k, slot);
void share_triangle(int slot) {
    EACH(SHARE)
#if PARTS
    s_rest[slot] = rest;
#ifdef FRESH
    s_age[slot] = age;
#endif
#endif
}

// Fold the first `count` rows of a shared triangle, all or none of them.
void fold_triangle(int slot, int count) {
    for (int k = 0; k < count; ++k) {
        for (int j = 0; j < COLUMNS; ++j) row[j] = j < k ? 0.0 : s_triangle[entry(k, j) * SLOTS + slot];
        fold_row();
    }
#if PARTS
    rest += count > 0 ? s_rest[slot] : 0.0;
#ifdef FRESH
    age += count > 0 ? s_age[slot] : 0.0;
#endif
#endif
}

// The triangle of all rows of the group, in shared memory at slot 0. To be called by the whole group. Where it has more
// invocations than there are parts, those whose numbers differ by a multiple of PARTS have shared one.
void merge_triangles(int thread) {
    for (int count = THREADS / 2; count > 0; count /= 2) {
        barrier();
        if (thread >= count && thread < 2 * count) share_triangle(thread - count);
        barrier();
        fold_triangle(min(thread, count - 1), thread < count ? FEATURES : 0);
#if PARTS
        if (count == PARTS && thread < count) share_triangle(LANES + thread);
#endif
    }
    if (thread == 0) share_triangle(0);
}

float shared_entry(int slot, int k, int j) { return s_triangle[entry(k, j) * SLOTS + slot]; }

// Take column k out of a shared triangle: what is left of its row belongs to the rows below.
void drop_column(int slot, int k) {
    for (int i = k + 1; i < FEATURES; ++i) {
        float a = shared_entry(slot, i, i), b = shared_entry(slot, k, i);
        float square = a * a + b * b;
        if (square <= 1e-20) continue;
        float inverse = inversesqrt(square), c = a * inverse, s = b * inverse;
        for (int j = i; j < COLUMNS; ++j) {
            float upper = shared_entry(slot, i, j), lower = shared_entry(slot, k, j);
            s_triangle[entry(i, j) * SLOTS + slot] = c * upper + s * lower;
            s_triangle[entry(k, j) * SLOTS + slot] = c * lower - s * upper;
        }
    }
}

// Rank test of a shared triangle. Feature 0 is the constant, whose length is the root of the number of rows. A feature of
// which no more than `tolerance` per row, root of the mean square, cannot be had from those before it is dropped: the
// others get the least squares without it.
void drop_dependent(int slot, float tolerance) {
    float tiny = tolerance * shared_entry(slot, 0, 0);
    for (int k = 0; k < FEATURES; ++k) {
        // A loop of one turn or none, not a branch: a software rasteriser runs both sides of that.
        int end = shared_entry(slot, k, k) > tiny ? k : k + 1;
        for (int i = k; i < end; ++i) {
            drop_column(slot, i);
            s_triangle[entry(i, i) * SLOTS + slot] = 0.0;
        }
    }
}

// Weights of the features in s_weights, 0 for those that are dropped; by one invocation after merge_triangles().
void solve(float tolerance) {
    drop_dependent(0, tolerance);
    for (int k = FEATURES - 1; k >= 0; --k) {
        vec3 color = vec3(
            shared_entry(0, k, FEATURES), shared_entry(0, k, FEATURES + 1), shared_entry(0, k, FEATURES + 2)
        );
        for (int j = k + 1; j < FEATURES; ++j) color -= shared_entry(0, k, j) * s_weights[j];
        float diagonal = shared_entry(0, k, k);
        s_weights[k] = diagonal > 0.0 ? color / diagonal : vec3(0.0);
    }
}
