#version 430
// Limits the offset of ray origins to the smooth surface, and tests whether a face crosses the texel. The same
// algorithm as kernels/visibility/ray_offsets.cl.
#define RECEIVER_ACCESS
#include "bvh_traversal.glsl"
#include "receiver.glsl"
#include "texel_ray_origins.glsl"

layout(local_size_x = 64) in;
uniform int start, end;

// Test points of a texel for the offset, in texels from its centre.
const vec2 TRIED[5] = vec2[](vec2(0.0), vec2(-0.4, -0.4), vec2(0.4, -0.4), vec2(-0.4, 0.4), vec2(0.4, 0.4));

// The offset is 0 where the surface is flat, concave or inverted; else at most half of the distance to the geometry
// above, so that ray origins stay on this side of it.
void main()
{
    int patch_ = start + int(gl_GlobalInvocationID.x);
    if (patch_ >= end)
        return;
    Receiver r = load_receiver(patch_);
    float lifted = smooth_offset(r, r.at) != vec3(0.0) ? 1.0 : 0.0;
    for (int i = 0; i < 5 && lifted > 0.0; ++i) {
        vec3 p = point_of_texel(r, TRIED[i] + 0.5), lift = smooth_offset(r, p);
        if (lift != vec3(0.0))
            lifted = min(lifted, 0.5 * nearest_hit(p + r.height * r.geometric, lift, false).distance);
    }
    receivers[patch_].lifted = lifted;
    if (is_crossed(r))
        receivers[patch_].rank |= 1;
}
