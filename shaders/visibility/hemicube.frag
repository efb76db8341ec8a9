#version 410
// With IDENTITY: stores the index of the visible patch plus 1, with the highest bit set for its back face. Without:
// stores the radiance of that patch. The radiosity texture holds two values per patch: radiance of the front face, with
// a = 1, in its lower half; emission only, which is the radiance of the back face, with a = 0, in its upper half.
// BACK_TO_BACK is defined for scenes with coincident faces of different radiance: the front face of the two is visible.
// BACKS is defined for scenes whose back faces are triangles of their own: the atlas of these and of their front faces
// is stored as -1 - atlas, and only front faces of either are drawn. REVERSED_DEPTH: the farthest depth is 0.
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
#ifdef TRANSMISSION
in vec3 cutout;
in vec2 cutout_back;
#endif
#ifdef ANGULAR
in vec3 towards;
#endif

#ifdef BACK_TO_BACK
// Moves a back face that may coincide with a front face away, and returns its inverse distance. The shift exceeds the
// depth difference that drivers produce for two triangles of one plane: corners are snapped to a grid of at least 1/16
// pixel (OpenGL 4.1, 3.4), so depth deviates by the slope over 1/32 pixel in each, and it is interpolated in float32.
// The result is at least 0, which is infinity.
float moved_away(float inverse, float slope)
{
    return inverse * inverse / (inverse * (1.0 + 1e-4) + 0.125 * slope);
}
#endif

void main()
{
#ifdef BACK_TO_BACK
    float slope = fwidth(gl_FragCoord.z);
#endif
    float atlas = lightmap_uv.z;
#ifdef BACKS
    if (atlas < -0.5) {
        if (!gl_FrontFacing)
            discard;
        atlas = -1.0 - atlas;
    }
#endif
#ifdef TRANSMISSION
#ifdef ANGULAR
    vec3 across = cross(dFdx(towards), dFdy(towards));
    float cosine = min(abs(dot(across, towards)) / max(length(across) * length(towards), 1e-30), 1.0);
#else
    const float cosine = 1.0;
#endif
    if (is_hole(cutout, cutout_back, lightmap_uv.xy, cosine))
        discard;
#endif
#ifdef BACK_TO_BACK
    float depth = gl_FragCoord.z;
#ifdef REVERSED_DEPTH
    gl_FragDepth = gl_FrontFacing ? depth : moved_away(depth, slope);
#else
    gl_FragDepth = gl_FrontFacing ? depth : 1.0 - moved_away(1.0 - depth, slope);
#endif
#endif
    ivec2 size = textureSize(texel_to_patch, 0).xy;
    ivec2 texel = clamp(ivec2(lightmap_uv.xy * vec2(size)), ivec2(0), size - 1);
    int entry = int(texelFetch(texel_to_patch, ivec3(texel, int(atlas + 0.5)), 0).r);
#ifdef IDENTITY
    out_identity = uint(entry) | (gl_FrontFacing ? 0u : 0x80000000u);
#else
    ivec2 half_size = textureSize(radiosity, 0) / ivec2(1, 2);
    int row = entry / half_size.x + (gl_FrontFacing ? 0 : half_size.y);
    out_radiance = texelFetch(radiosity, ivec2(entry % half_size.x, row), 0);
#endif
}
