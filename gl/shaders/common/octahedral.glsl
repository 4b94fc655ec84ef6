// Unit vectors in one float: octahedral map (Cigolle et al. 2014) at 12 bits a side, as an integer below 2^24.
//
// The integer is stored by value, not by bit pattern: patterns of NaNs and denormals do not survive every driver.

float encode_normal(vec3 n) {
    n /= max(abs(n.x) + abs(n.y) + abs(n.z), 1e-20);
    vec2 o = n.z >= 0.0 ? n.xy : (1.0 - abs(n.yx)) * mix(vec2(-1.0), vec2(1.0), greaterThanEqual(n.xy, vec2(0.0)));
    vec2 q = floor(clamp(o * 0.5 + 0.5, 0.0, 1.0) * 4095.0 + 0.5);
    return q.x * 4096.0 + q.y;
}

vec3 decode_normal(float code) {
    float x = floor(code / 4096.0);
    vec2 o = vec2(x, code - x * 4096.0) / 4095.0 * 2.0 - 1.0;
    vec3 n = vec3(o, 1.0 - abs(o.x) - abs(o.y));
    float t = max(-n.z, 0.0);
    n.xy -= mix(vec2(-t), vec2(t), greaterThanEqual(n.xy, vec2(0.0)));
    return normalize(n);
}
