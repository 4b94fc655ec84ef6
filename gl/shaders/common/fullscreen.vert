// One triangle that covers the screen, made from the vertex number alone: corners (-1,-1), (3,-1), (-1,3).
// A triangle has no inner edge, where two triangles would shade the pixels of the diagonal's 2x2 quads twice.
// There is nothing to interpolate: fragment shaders take their pixel from gl_FragCoord.
void main() {
    gl_Position = vec4(4.0 * (gl_VertexID & 1) - 1.0, 2.0 * (gl_VertexID & 2) - 1.0, 0.0, 1.0);
}
