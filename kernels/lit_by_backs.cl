// 1 for patches that see the back of a triangle that shines.
__kernel void lit_by_backs(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, __global const uchar *shines,
                           __global uchar *result, const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + patch);
    float3 x, y;
    basis(r.geometric, &x, &y);
    uchar lit = 0;
    for (int i = 0; i < LOOKS && !lit; ++i) {
        const Hit hit = nearest_hit(&rays, r.at + r.height * r.geometric, look(i, x, y, r.geometric), false);
        lit = hit.triangle >= 0 && !hit.front && shines[hit.triangle];
    }
    result[patch] = lit;
}
