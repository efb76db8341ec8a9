#version 410
// Draws a mesh in lightmap space: its lightmap UVs become positions (paper, IV.A).
in vec2 in_uv;
out vec2 barycentric;

void main()
{
    int corner = gl_VertexID % 3;
    barycentric = vec2(corner == 0 ? 1.0 : 0.0, corner == 1 ? 1.0 : 0.0);
    gl_Position = vec4(2.0 * in_uv - 1.0, 0.0, 1.0);
}
