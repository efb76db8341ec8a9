// L1 of the light that patches gather from what they see, known as rows of patch numbers, with that of the
// static light. One patch a group, of the rows of patches from `cached_from` on.
__kernel void gather_l1(__global const Front *cache, const int cached_from, __global const float4 *radiance,
                        __global const ReceiverRecord *receivers, SAMPLES, const int samples, const int n,
                        const uint salt, const int rotate, const int start, __global const float4 *static_l1,
                        __global float4 *l1, __local float4 *partial)
{
    const int patch = start + get_group_id(0);
    __global const Front *row = cache + (size_t)(patch - cached_from) * samples;
    const Receiver receiver = load_receiver(receivers + patch);
    const View view = view_of(&receiver, patch, salt, rotate);
    L1 sum = {(float4)(0.0f), (float4)(0.0f), (float4)(0.0f)};
    for (int i = get_local_id(0); i < samples; i += get_local_size(0))
        if (row[i])
            add_l1(&sum, WEIGHT(i) * radiance[row[i]].xyz, tilt_of(sample_direction(&view, i, pattern, n), view.normal));
    if (get_local_id(0) == 0) {
        sum.x += static_l1[3 * (size_t)patch];
        sum.y += static_l1[3 * (size_t)patch + 1];
        sum.z += static_l1[3 * (size_t)patch + 2];
    }
    store_l1(&sum, patch, l1, partial);
}
