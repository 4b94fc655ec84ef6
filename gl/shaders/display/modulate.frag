// Full radiance: (direct + indirect) · albedo + emission. Schied et al. 2017, sec. 4.

uniform sampler2D in_direct;
#if HAS_IN_INDIRECT
uniform sampler2D in_indirect;
#endif
#if HAS_IN_ALBEDO
uniform sampler2D in_albedo;
#endif
uniform sampler2D in_emission;

layout(location = 0) out vec4 out_radiance;

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    vec3 c = texelFetch(in_direct, p, 0).rgb;
#if HAS_IN_INDIRECT
    c += texelFetch(in_indirect, p, 0).rgb;
#endif
#if HAS_IN_ALBEDO
    c *= texelFetch(in_albedo, p, 0).rgb;
#endif
    out_radiance = vec4(c + texelFetch(in_emission, p, 0).rgb, 1.0);
}
