#version 410
// Added up by blending: the number of triangles that cover a texel's centre.
layout(location = 0) out vec4 out_count;

void main()
{
    out_count = vec4(1.0);
}
