#version 410
// One texel becomes one patch: barycentric coordinate and mesh, face, subface; a = 1 marks it valid.
in vec3 barycentric;
flat in vec3 identity;
layout(location = 0) out vec4 out_barycentric;
layout(location = 1) out vec4 out_identity;

void main()
{
    out_barycentric = vec4(barycentric, 1.0);
    out_identity = vec4(identity, 1.0);
}
