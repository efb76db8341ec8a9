#include "bvh_traversal.cl"
#include "receiver.cl"
#include "validity.cl"

// Stores 1 for patches with more than `most` back faces among the hits of their LOOKS probe rays.
__kernel void hits_many_backfaces(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, const int most,
                                  __global uchar *result, const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + patch);
    const float3 start = r.at + r.height * r.geometric;
    result[patch] = !hits_few_backfaces(&rays, start, r.geometric, 0, 0.0f, most);
}
