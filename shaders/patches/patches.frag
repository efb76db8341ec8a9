#version 410
// Stores one patch per texel: its triangle + 1, and the barycentrics of the triangle's first two corners.
in vec2 barycentric;
layout(location = 0) out uint out_triangle;
layout(location = 1) out vec2 out_barycentric;

void main()
{
    out_triangle = uint(gl_PrimitiveID) + 1u;
    out_barycentric = barycentric;
}
