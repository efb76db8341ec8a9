// 1 for patches that are inside of something: of what they see most are backs.
__kernel void inside(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, __global uchar *result, const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + patch);
    result[patch] = !sees_out(&rays, r.at + r.height * r.geometric, r.geometric);
}
