#version 410
// One invocation a hemicube face; instances are hemicubes. The slot of a hemicube is its place in
// the texture array: layer by layer, in each layer tile by tile (paper, IV.B).
layout(triangles, invocations = 5) in;
layout(triangle_strip, max_vertices = 3) out;
in vec3 position[];
in vec3 lookup[];
flat in int instance[];
uniform sampler2D matrices;
uniform int first_layer;
uniform int first_tile;
uniform int tiles_drawn;
uniform int tiles_per_layer;
uniform int hemicubes;
out vec3 lightmap_uv;
#ifdef CUTOUTS
in vec3 cutout_corner[];
out vec3 cutout;
#endif

vec4 row(int slot, int index)
{
    return texelFetch(matrices, ivec2(4 * gl_InvocationID + index, slot), 0);
}

// True if all three corners lie beyond one of the planes of the face's frustum.
bool culled(vec4 p, vec4 q, vec4 r)
{
    vec3 x = vec3(p.x, q.x, r.x), y = vec3(p.y, q.y, r.y), w = vec3(p.w, q.w, r.w);
    return all(greaterThan(x, w)) || all(lessThan(x, -w)) || all(greaterThan(y, w)) || all(lessThan(y, -w));
}

void main()
{
    int tile = instance[0] % tiles_drawn;
    int layer = first_layer + instance[0] / tiles_drawn;
    int slot = layer * tiles_per_layer + first_tile + tile;
    if (slot >= hemicubes)
        return;

    mat4 world_to_clip = transpose(mat4(row(slot, 0), row(slot, 1), row(slot, 2), row(slot, 3)));
    vec4 clip[3];
    for (int i = 0; i < 3; ++i)
        clip[i] = world_to_clip * vec4(position[i], 1.0);
    if (culled(clip[0], clip[1], clip[2]))
        return;

    for (int i = 0; i < 3; ++i) {
        gl_Position = clip[i];
        gl_Layer = layer;
        gl_ViewportIndex = 5 * tile + gl_InvocationID;
        lightmap_uv = lookup[i];
#ifdef CUTOUTS
        cutout = cutout_corner[i];
#endif
        EmitVertex();
    }
    EndPrimitive();
}
