// Sum of the noisy signals before a filter takes them together, and their albedo where the filter is to see it.

uniform sampler2D in_direct;
#if HAS_IN_INDIRECT
uniform sampler2D in_indirect;
#endif
#if HAS_IN_ALBEDO
uniform sampler2D in_albedo;
#endif
#ifdef GLOSSY
uniform sampler2D in_specular;
uniform sampler2D in_specular_albedo;
#endif

layout(location = 0) out vec4 out_color;

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    vec4 direct = texelFetch(in_direct, p, 0); // a: where the sample comes from, handed on
    vec3 c = direct.rgb;
#if HAS_IN_INDIRECT
    c += texelFetch(in_indirect, p, 0).rgb;
#endif
#if HAS_IN_ALBEDO
    c *= texelFetch(in_albedo, p, 0).rgb;
#endif
#ifdef GLOSSY
    c += texelFetch(in_specular, p, 0).rgb * texelFetch(in_specular_albedo, p, 0).rgb;
#endif
    out_color = vec4(c, direct.a);
}
