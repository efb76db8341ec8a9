#version 430
// Integrates one rasterised hemicube per work group: sums its texels' radiance times the multiplier map (paper, IV.C,
// in one step). rgb is radiance; a is 1 for front faces. Texels with the cleared depth show the background; the colour
// texture is not cleared. Texels below the geometric horizon contribute nothing.
#include "hemicube.glsl"
#ifdef REVERSED_DEPTH
const float FARTHEST = 0.0;
#else
const float FARTHEST = 1.0;
#endif
uniform sampler2DArray hemicubes;
uniform sampler2DArray depths;
#ifdef SKY
#define NOTHING background_radiance(frame, direction)
#else
uniform vec3 even_sky;
#define NOTHING even_sky
#endif
layout(std430, binding = 2) writeonly buffer Irradiance { vec4 irradiance[]; };

void main()
{
    int slot = int(gl_WorkGroupID.x);
    ivec3 first = origin(slot);
    Frame frame = frames[slot];
    vec4 sum = vec4(0.0);
    for (int i = int(gl_LocalInvocationIndex); i < 3 * n * n; i += int(GROUP)) {
        ivec2 at = texel_at(i);
        vec3 direction = texel_direction(at);
        if (dot(direction, frame.horizon.xyz) > 0.0) {
            ivec3 texel = first + ivec3(at, 0);
            vec4 value = texelFetch(hemicubes, texel, 0);
            if (texelFetch(depths, texel, 0).r == FARTHEST)
                value = vec4(NOTHING, 1.0);
            sum += multiplier[i] * value;
        }
    }
    sum = sum_of_group(sum);
    if (gl_LocalInvocationIndex == 0u)
        irradiance[slot] = sum;
}
