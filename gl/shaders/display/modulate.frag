// Full radiance: (direct + indirect) · albedo + emission. Schied et al. 2017, sec. 4.
//
// GLOSSY: + specular · its albedo; or, without a specular signal, all light · (albedo + specular albedo).

uniform sampler2D in_direct;
#if HAS_IN_INDIRECT
uniform sampler2D in_indirect;
#endif
#if HAS_IN_ALBEDO
uniform sampler2D in_albedo;
#endif
#ifdef GLOSSY
#if HAS_IN_SPECULAR
uniform sampler2D in_specular;
#endif
#if HAS_IN_SPECULAR_ALBEDO
uniform sampler2D in_specular_albedo;
#endif
#endif
uniform sampler2D in_emission;

layout(location = 0) out vec4 out_radiance;

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    vec3 c = texelFetch(in_direct, p, 0).rgb;
#if HAS_IN_INDIRECT
    c += texelFetch(in_indirect, p, 0).rgb;
#endif
    vec3 albedo = vec3(1.0);
#if HAS_IN_ALBEDO
    albedo = texelFetch(in_albedo, p, 0).rgb;
#endif
    vec3 shine = vec3(0.0);
#ifdef GLOSSY
    vec3 gloss = vec3(1.0);
#if HAS_IN_SPECULAR_ALBEDO
    gloss = texelFetch(in_specular_albedo, p, 0).rgb;
#endif
#if HAS_IN_SPECULAR
    shine = texelFetch(in_specular, p, 0).rgb * gloss;
#else
    albedo += gloss;
#endif
#endif
    out_radiance = vec4(c * albedo + shine + texelFetch(in_emission, p, 0).rgb, 1.0);
}
