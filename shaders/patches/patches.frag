#version 410
// Stores one patch per texel: its triangle + 1, and the bits of the barycentrics of the triangle's first two corners.
// Additive blending of the third target, in 8 bits, counts the triangles that cover the centre; integers do not blend.
in vec2 barycentric;
layout(location = 0) out uint out_triangle;
layout(location = 1) out uvec2 out_barycentric;
layout(location = 2) out vec4 out_count;

void main()
{
    out_triangle = uint(gl_PrimitiveID) + 1u;
    out_barycentric = floatBitsToUint(barycentric);
    out_count = vec4(1.0 / 255.0);
}
