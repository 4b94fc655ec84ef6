// Display light to 8-bit sRGB.

#include "common/color.glsl"

uniform sampler2D in_color;

layout(location = 0) out vec4 out_color;

void main() { out_color = vec4(encode_srgb(texelFetch(in_color, ivec2(gl_FragCoord.xy), 0).rgb), 1.0); }
