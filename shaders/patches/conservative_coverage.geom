#version 410
// Conservative rasterisation: covers every texel that a triangle touches, not only texels whose centre it covers. Draws
// the triangle's bounding box, one texel larger on each side; the fragment shader tests each texel exactly.
layout(triangles) in;
layout(triangle_strip, max_vertices = 4) out;
in vec2 corner[];
uniform float resolution;
flat out vec2 a, b, c;
flat out uint triangle;

void main()
{
    vec2 low = min(min(corner[0], corner[1]), corner[2]) - 1.0;
    vec2 high = max(max(corner[0], corner[1]), corner[2]) + 1.0;
    for (int i = 0; i < 4; ++i) {
        vec2 texel = vec2((i & 1) == 0 ? low.x : high.x, (i & 2) == 0 ? low.y : high.y);
        a = corner[0];
        b = corner[1];
        c = corner[2];
        triangle = uint(gl_PrimitiveIDIn) + 1u;
        gl_Position = vec4(2.0 * texel / resolution - 1.0, 0.0, 1.0);
        EmitVertex();
    }
    EndPrimitive();
}
