#version 410
// The radiance of the patch that is seen. Emission leaves both sides of a surface, reflected light
// the front only; a = 0 counts back faces.
in vec3 lightmap_uv;
uniform usampler2DArray owners;
uniform sampler2D radiance;
uniform sampler2D emission;
layout(location = 0) out vec4 out_radiance;

void main()
{
    ivec2 size = textureSize(owners, 0).xy;
    ivec2 texel = clamp(ivec2(lightmap_uv.xy * vec2(size)), ivec2(0), size - 1);
    int patch_id = int(texelFetch(owners, ivec3(texel, int(lightmap_uv.z + 0.5)), 0).r) - 1;
    int width = textureSize(radiance, 0).x;
    ivec2 place = ivec2(patch_id % width, patch_id / width);
    if (patch_id < 0)
        out_radiance = vec4(0.0, 0.0, 0.0, 1.0);
    else if (gl_FrontFacing)
        out_radiance = vec4(texelFetch(radiance, place, 0).rgb, 1.0);
    else
        out_radiance = vec4(texelFetch(emission, place, 0).rgb, 0.0);
}
