#include "bvh_traversal.cl"
#include "receiver.cl"
#include "emitters.cl"
#include "hemisphere_openness.cl"

// Computes ambient occlusion: the cosine-weighted fraction of each patch's hemisphere without geometry nearer than
// `reach` (metres), from `budget` rays. 1 is unoccluded.
__kernel void ambient_occlusion(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, const int budget,
                                const float reach, const uint seed, __global float4 *result, const int start,
                                const int end)
{
    const int patch = start + get_global_id(0);
    if (patch >= end)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + patch);
    float3 x, y;
    basis(r.normal, &x, &y);
    Opening opening = {0.0f, 0.0f};
    const uint key = hash(r.rank ^ hash(seed));
    for (int i = 0; i < budget; ++i) {
        const float4 u = sample_point(i, key);
        look_out(&opening, &rays, &r, u.zw, cosine_direction(u.xy, x, y, r.normal), reach);
    }
    result[patch] = (float4)((float3)(open_part(&opening)), 0.0f);
}
