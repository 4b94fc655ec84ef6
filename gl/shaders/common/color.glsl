// Luminance, YCoCg, tone curves and the sRGB transfer function. Linear Rec. 709 unless said otherwise.

float luminance(vec3 c) { return dot(c, vec3(0.2126, 0.7152, 0.0722)); }

vec3 to_ycocg(vec3 c) {
    return vec3(0.25 * c.r + 0.5 * c.g + 0.25 * c.b, 0.5 * c.r - 0.5 * c.b, -0.25 * c.r + 0.5 * c.g - 0.25 * c.b);
}

vec3 from_ycocg(vec3 c) {
    float t = c.x - c.z;
    return vec3(t + c.y, c.x + c.z, t - c.y);
}

// Reinhard et al. 2002, eq. 3, per channel.
vec3 tonemap_reinhard(vec3 c) { return c / (1.0 + c); }

// Narkowicz 2015, "ACES Filmic Tone Mapping Curve": a fit of the reference transform's curve.
vec3 tonemap_aces(vec3 c) {
    // Both polynomials are of degree two: beyond 1e4 the quotient is 1 to display precision, and inf / inf is not.
    c = min(c, vec3(1e4));
    return clamp((c * (2.51 * c + 0.03)) / (c * (2.43 * c + 0.59) + 0.14), 0.0, 1.0);
}

// IEC 61966-2-1. pow of a negative number is undefined: clamp first.
vec3 encode_srgb(vec3 c) {
    c = clamp(c, 0.0, 1.0);
    return mix(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, 12.92 * c, vec3(lessThanEqual(c, vec3(0.0031308))));
}
