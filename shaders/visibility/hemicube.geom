#version 410
// Draws each triangle to the five hemicube faces, one invocation per face. The item holds the hemicube and the faces
// from which the triangle is visible.
layout(triangles, invocations = 5) in;
layout(triangle_strip, max_vertices = 3) out;
#include "project.glsl"
in vec3 position[];
in vec3 lookup[];
flat in uint item[];
uniform int first_tile;
uniform int tiles_per_layer;
out vec3 lightmap_uv;
#ifdef TRANSMISSION
in vec3 cutout_corner[];
in vec2 back_corner[];
out vec3 cutout;
out vec2 cutout_back;
#endif
#ifdef ANGULAR
out vec3 towards;
#endif

// Returns true if all three corners lie outside one of the planes of the face's frustum.
bool culled(vec4 p, vec4 q, vec4 r)
{
    vec3 x = vec3(p.x, q.x, r.x), y = vec3(p.y, q.y, r.y), w = vec3(p.w, q.w, r.w);
    return all(greaterThan(x, w)) || all(lessThan(x, -w)) || all(greaterThan(y, w)) || all(lessThan(y, -w));
}

void main()
{
    if ((item[0] >> gl_InvocationID & 1u) == 0u)
        return;
    int slot = int(item[0] >> 5);
    vec4 clip[3];
    for (int i = 0; i < 3; ++i)
        clip[i] = project(slot, gl_InvocationID, position[i]);
    if (culled(clip[0], clip[1], clip[2]))
        return;

    for (int i = 0; i < 3; ++i) {
        gl_Position = clip[i];
        gl_Layer = slot / tiles_per_layer;
        gl_ViewportIndex = 5 * (slot % tiles_per_layer - first_tile) + gl_InvocationID;
        lightmap_uv = lookup[i];
#ifdef TRANSMISSION
        cutout = cutout_corner[i];
        cutout_back = back_corner[i];
#endif
#ifdef ANGULAR
        towards = along_axes(gl_InvocationID, clip[i]);
#endif
        EmitVertex();
    }
    EndPrimitive();
}
