// All light of a surface that reflects in two ways, over all that it reflects.

uniform sampler2D in_direct;
uniform sampler2D in_indirect;
uniform sampler2D in_specular;
uniform sampler2D in_albedo;
uniform sampler2D in_specular_albedo;

layout(location = 0) out vec4 out_color;

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    vec4 direct = texelFetch(in_direct, p, 0); // a: where the sample comes from, handed on
    vec3 diffuse = direct.rgb + texelFetch(in_indirect, p, 0).rgb;
    vec3 albedo = texelFetch(in_albedo, p, 0).rgb, gloss = texelFetch(in_specular_albedo, p, 0).rgb;
    vec3 radiance = diffuse * albedo + texelFetch(in_specular, p, 0).rgb * gloss;
    // A diffuse surface keeps its illumination to the bit, a black one has no other.
    out_color = vec4(mix(diffuse, radiance / max(albedo + gloss, 1e-30), greaterThan(gloss, vec3(0.0))), direct.a);
}
