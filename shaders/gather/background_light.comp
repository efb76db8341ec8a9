#version 430
// Computes background light, constant over all iterations, from hemicube item buffers. An item-buffer texel holds the
// index of the visible patch plus 1 (0: none), with the highest bit set for its back face; or the value for the
// background. The sum has the background's radiance and the emission of back faces in rgb, and the fraction of the
// hemisphere without back faces in a. `cache` keeps only front faces; all other texels become 0, no patch.
#include "hemicube.glsl"
const uint BACK = 0x80000000u, SURROUNDINGS = 0x7FFFFFFFu;
uniform usampler2DArray hemicubes;
uniform int first_slot;
layout(std430, binding = 2) writeonly buffer StaticLight { vec4 static_light[]; };
layout(std430, binding = 3) writeonly buffer Cache { uint cache[]; };
layout(std430, binding = 4) readonly buffer Emission { vec4 emission[]; };

void main()
{
    int hemicube = int(gl_WorkGroupID.x), slot = first_slot + hemicube;
    ivec3 first = origin(slot);
    Frame frame = frames[slot];
    vec4 sum = vec4(0.0);
    for (int i = int(gl_LocalInvocationIndex); i < 3 * n * n; i += int(GROUP)) {
        ivec2 at = texel_at(i);
        vec3 direction = texel_direction(at);
        uint seen = texelFetch(hemicubes, first + ivec3(at, 0), 0).r, front = 0u;
        if (dot(direction, frame.horizon.xyz) > 0.0) {
            vec4 value = vec4(0.0, 0.0, 0.0, 1.0);
            uint entry = seen & ~BACK;
            if (seen == SURROUNDINGS)
                value.rgb = background_radiance(frame, direction);
            else if (entry == seen)
                front = seen;
            else
                value = vec4(emission[entry].rgb, entry == 0u ? 1.0 : 0.0);
            sum += multiplier[i] * value;
        }
        cache[3 * n * n * hemicube + i] = front;
    }
    sum = sum_of_group(sum);
    if (gl_LocalInvocationIndex == 0u)
        static_light[hemicube] = sum;
}
