// The guide of the guided filter: normal and depth, four numbers.

// What a row is told from. Where there is no surface, any finite guide will do.
vec4 guide_at(sampler2D surfaces, ivec2 q) {
    vec4 s = texelFetch(surfaces, q, 0);
    return is_finite(s) ? s : vec4(0.0);
}
