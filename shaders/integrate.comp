#version 430
// One group a hemicube: the sum of its texels' radiance times the multiplier, read where it was drawn
// (paper, IV.C, in one step). rgb is radiance; a is 1 where the front of a surface or the surroundings
// are seen, and 2 where the surroundings still have to be looked up. No light comes from below the horizon.
#include "hemicube.glsl"
uniform sampler2DArray hemicubes;
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
            vec4 value = texelFetch(hemicubes, first + ivec3(at, 0), 0);
#ifdef SKY
            if (value.a > 1.5)
                value = vec4(surroundings(frame, direction), 1.0);
#endif
            sum += multiplier[i] * value;
        }
    }
    sum = sum_of_group(sum);
    if (gl_LocalInvocationIndex == 0u)
        irradiance[slot] = sum;
}
