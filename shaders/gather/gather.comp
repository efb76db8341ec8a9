#version 430
// One gather iteration over cached hemicube item buffers: sums the weighted radiance of the visible front faces and
// adds the background light.
#include "hemicube.glsl"
layout(std430, binding = 2) writeonly buffer Irradiance { vec4 irradiance[]; };
layout(std430, binding = 3) readonly buffer Cache { uint cache[]; };
layout(std430, binding = 4) readonly buffer Radiance { vec4 radiance[]; };
layout(std430, binding = 5) readonly buffer StaticLight { vec4 static_light[]; };

void main()
{
    int hemicube = int(gl_WorkGroupID.x);
    vec4 sum = vec4(0.0);
    for (int i = int(gl_LocalInvocationIndex); i < 3 * n * n; i += int(GROUP))
        sum += multiplier[i] * radiance[cache[3 * n * n * hemicube + i]];
    sum = sum_of_group(sum);
    if (gl_LocalInvocationIndex == 0u)
        irradiance[hemicube] = sum + static_light[hemicube];
}
