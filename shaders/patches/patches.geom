#version 410
// Moves the lightmap UVs of each triangle to texel borders, by at most half a texel, so that texels are covered fully
// or not at all (paper, VI.B). A triangle that would become empty or turn over is not moved.
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;
uniform float resolution;
out vec2 barycentric;

// Returns twice the area of a triangle, in texels; positive if counter-clockwise.
float area(vec2 a, vec2 b, vec2 c) { return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x); }

void main()
{
    vec2 corner[3], moved[3];
    for (int i = 0; i < 3; ++i) {
        corner[i] = (0.5 * gl_in[i].gl_Position.xy + 0.5) * resolution;
        moved[i] = floor(corner[i] + 0.5);
    }
    float before = area(corner[0], corner[1], corner[2]), after = area(moved[0], moved[1], moved[2]);
    bool kept = before * after > 0.0;
    for (int i = 0; i < 3; ++i) {
        gl_Position = kept ? vec4(2.0 * moved[i] / resolution - 1.0, 0.0, 1.0) : gl_in[i].gl_Position;
        gl_PrimitiveID = gl_PrimitiveIDIn;
        barycentric = vec2(i == 0 ? 1.0 : 0.0, i == 1 ? 1.0 : 0.0);
        EmitVertex();
    }
    EndPrimitive();
}
