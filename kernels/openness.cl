// How open the surroundings of patches are, as far as a few texels: what light that others show cannot tell of a patch.

// The fraction of each patch's hemisphere, weighted by the cosine, in which nothing is nearer than `reach` texels.
// Rays are the same ones for all patches, so that they differ by what is around patches alone.
__kernel void openness(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, const float reach,
                       __global float *open, const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + patch);
    float3 x, y;
    basis(r.normal, &x, &y);
    Opening opening = {0.0f, 0.0f};
    for (int i = 0; i < LOOKS; ++i)
        look_out(&opening, &rays, &r, place_of_sample(i, (uint2)(0)), look(i, x, y, r.normal), reach * r.size);
    open[patch] = open_part(&opening);
}
