#version 410
// With IDENTITY defined: which patch is seen, plus 1, and the highest bit for its back. Without: what
// that patch sends out. The radiosity texture holds two values a patch: the front,
// a = 1, in its lower half; emission alone, which leaves the back too, a = 0, in its upper half.
in vec3 lightmap_uv;
uniform usampler2DArray texel_to_patch;
#ifndef IDENTITY
uniform sampler2D radiosity;
#endif
#ifdef IDENTITY
layout(location = 0) out uint out_identity;
#else
layout(location = 0) out vec4 out_radiance;
#endif
#ifdef CUTOUTS
in vec3 cutout;
#endif

void main()
{
#ifdef CUTOUTS
    if (is_hole(cutout, lightmap_uv.xy))
        discard;
#endif
    ivec2 size = textureSize(texel_to_patch, 0).xy;
    ivec2 texel = clamp(ivec2(lightmap_uv.xy * vec2(size)), ivec2(0), size - 1);
    int entry = int(texelFetch(texel_to_patch, ivec3(texel, int(lightmap_uv.z + 0.5)), 0).r);
#ifdef IDENTITY
    out_identity = uint(entry) | (gl_FrontFacing ? 0u : 0x80000000u);
#else
    ivec2 half_size = textureSize(radiosity, 0) / ivec2(1, 2);
    int row = entry / half_size.x + (gl_FrontFacing ? 0 : half_size.y);
    out_radiance = texelFetch(radiosity, ivec2(entry % half_size.x, row), 0);
#endif
}
