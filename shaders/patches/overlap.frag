#version 410
// Counts the triangles that cover a texel's centre, by additive blending in steps of an 8-bit target.
layout(location = 0) out vec4 out_count;

void main()
{
    out_count = vec4(1.0 / 255.0);
}
