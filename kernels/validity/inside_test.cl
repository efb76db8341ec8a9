#include "bvh_traversal.cl"
#include "receiver.cl"
#include "validity.cl"

// Early-out of the inside test: returns true if one of the first probe rays hits a back face. Otherwise the patch is
// outside.
bool hits_backface(const Rays *rays, const float3 start, const float3 normal)
{
    float3 x, y;
    basis(normal, &x, &y);
    bool back = false;
    for (int i = 0; i < FIRST_PROBES_OPEN && !back; ++i) {
        const Hit hit = nearest_hit(rays, start, probe_direction(7 * i % LOOKS, x, y, normal), false);
        back = hit.triangle >= 0 && !hit.front;
    }
    return back;
}

// Stores 1 for patches inside geometry: more than half of their probe rays hit back faces.
__kernel void is_inside(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, __global uchar *result,
                        const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + patch);
    const float3 start = r.at + r.height * r.geometric;
    result[patch] = hits_backface(&rays, start, r.geometric) && !is_outside(&rays, start, r.geometric);
}
