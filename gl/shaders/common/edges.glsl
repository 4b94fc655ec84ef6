// Edge-stopping functions of the noise-free guides. Schied et al. 2017, sec. 4.4, eq. 3 and 4.
//
// A surface is its normal and its depth. Needs common/finite.glsl. None of these is more than a rounding above 1; a guide that is not finite may
// make them NaN: sane_weight() of common/finite.glsl has the last word.

// Whether anything is seen there, and its guides are finite.
bool is_surface(vec4 s) { return is_finite(s) && s.w > 0.0; }

// Depth that a plane may be off at a distance of `d` pixels. Its floor is a tenth of a pixel's width for each pixel: on
// a plane that faces the camera the gradient is 0, and rounding of the depth must not cut the surface in pieces.
float depth_range(vec2 gradient, vec2 d, float sigma_z, float pixel_width) {
    return sigma_z * abs(dot(gradient, d)) + 0.1 * pixel_width * length(d) + 1e-30;
}

float normal_weight(vec3 n, vec3 m, float sigma_n) { return pow(max(dot(n, m), 0.0), sigma_n); }

// pixel_width: of a pixel on the surface, in units of the scene.
float surface_weight(vec4 s, vec4 t, vec2 gradient, vec2 d, float sigma_z, float sigma_n, float pixel_width) {
    float off = abs(s.w - t.w) / depth_range(gradient, d, sigma_z, pixel_width);
    return normal_weight(s.xyz, t.xyz, sigma_n) * exp(-off);
}
