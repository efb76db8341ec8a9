#version 410
// Lays a mesh out flat: lightmap UVs become positions (paper, IV.A).
in vec2 in_uv;
in vec3 in_identity;
in vec3 in_corner;
out vec3 barycentric;
flat out vec3 identity;

void main()
{
    barycentric = in_corner;
    identity = in_identity;
    gl_Position = vec4(2.0 * in_uv - 1.0, 0.0, 1.0);
}
