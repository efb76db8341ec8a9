// 1 for patches hidden by a face that touches them: a ray against the geometric normal, from `above` to `below`
// the surface, both in heights of the eye, meets the back of that face.
__kernel void in_contact(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, const float above, const float below,
                         __global uchar *result, const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + patch);
    const float3 up = r.height * r.geometric;
    const Hit hit = nearest_hit(&rays, r.at + above * up, -(above + below) * up, true);
    result[patch] = hit.triangle >= 0 && hit.distance <= 1.0f;
}
