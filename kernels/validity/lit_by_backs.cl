#include "bvh_traversal.cl"
#include "receiver.cl"
#include "validity.cl"

// Returns true if a point is behind one of the planes (normal, distance from the origin). Returns true if there are no
// planes.
bool is_behind_any(const float3 point, __global const float4 *planes, const int count)
{
    bool behind = count == 0;
    for (int i = 0; i < count && !behind; ++i)
        behind = dot(planes[i].xyz, point) < planes[i].w;
    return behind;
}

// Stores 1 for patches whose probe rays hit an emissive back face before more than MAX_OTHERS_BACKLIT others. Emissive
// back faces are visible only from behind, so patches in front of all emissive planes are skipped.
__kernel void lit_by_backfaces(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, __global const uchar *shines,
                               __global const float4 *planes, const int plane_count, __global uchar *result,
                               const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + patch);
    const float3 start = r.at + r.height * r.geometric;
    const int looks = is_behind_any(start, planes, plane_count) ? LOOKS : 0;
    const Probes most = {LOOKS, MAX_OTHERS_BACKLIT, 0};
    result[patch] = probe(&rays, start, r.geometric, shines, INFINITY, looks, most).lit > 0;
}
