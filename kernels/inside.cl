#include "rays.cl"
#include "receiver.cl"
#include "validity.cl"

// True if one of the first looks, all around, meets a back: else a patch is not inside of anything.
bool sees_backs(const Rays *rays, const float3 start, const float3 normal)
{
    float3 x, y;
    basis(normal, &x, &y);
    bool back = false;
    for (int i = 0; i < FIRST_PROBES_OPEN && !back; ++i) {
        const Hit hit = nearest_hit(rays, start, look(7 * i % LOOKS, x, y, normal), false);
        back = hit.triangle >= 0 && !hit.front;
    }
    return back;
}

// 1 for patches that are inside of something: of what they see most are backs.
__kernel void inside(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, __global uchar *result, const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + patch);
    const float3 start = r.at + r.height * r.geometric;
    result[patch] = sees_backs(&rays, start, r.geometric) && !sees_out(&rays, start, r.geometric);
}
