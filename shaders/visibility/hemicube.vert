#version 410
// Draws one instance per item. An item is 32 x the slot of a hemicube, plus a face; a slot numbers the tiles of the
// texture array, layer by layer and in each layer tile by tile (paper, IV.B). With GEOMETRY the bits of faces are
// added, and the geometry shader projects the triangle. With VIEWPORTS the face selects its viewport. TRANSMISSION is
// defined for scenes with transparent surfaces.
#ifndef GEOMETRY
#extension GL_ARB_shader_viewport_layer_array : enable
#extension GL_AMD_vertex_shader_layer : enable
#extension GL_AMD_vertex_shader_viewport_index : enable
#endif
in vec3 in_position;
in vec3 in_lookup;
in uint in_item;
#ifdef TRANSMISSION
in vec3 in_cutout;
in vec2 in_cutout_back;
#endif

#ifdef GEOMETRY
out vec3 position;
out vec3 lookup;
flat out uint item;
#ifdef TRANSMISSION
out vec3 cutout_corner;
out vec2 back_corner;
#endif

void main()
{
    position = in_position;
    lookup = in_lookup;
    item = in_item;
#ifdef TRANSMISSION
    cutout_corner = in_cutout;
    back_corner = in_cutout_back;
#endif
}
#else
#include "project.glsl"
uniform int tiles_per_layer;
#ifdef VIEWPORTS
uniform int first_tile;
#endif
out vec3 lightmap_uv;
#ifdef TRANSMISSION
out vec3 cutout;
out vec2 cutout_back;
#endif
#ifdef ANGULAR
out vec3 towards;
#endif

void main()
{
    int slot = int(in_item >> 5), face = int(in_item & 31u);
    gl_Position = project(slot, face, in_position);
    gl_Layer = slot / tiles_per_layer;
#ifdef VIEWPORTS
    gl_ViewportIndex = 5 * (slot % tiles_per_layer - first_tile) + face;
#endif
    lightmap_uv = in_lookup;
#ifdef TRANSMISSION
    cutout = in_cutout;
    cutout_back = in_cutout_back;
#endif
#ifdef ANGULAR
    towards = along_axes(face, gl_Position);
#endif
}
#endif
