// How open the surroundings of patches are, as far as a few texels: what light that others show cannot tell of a patch.

// Rays of a patch: the same ones for all, so that they differ by what is around patches alone.
#define TRIES 16

// The fraction of each patch's hemisphere, weighted by the cosine, in which nothing is nearer than `reach` texels.
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
    float sum = 0.0f, tried = 0.0f;
    for (int i = 0; i < TRIES; ++i) {
        const float2 q = disk((float2)((i + 0.5f) / TRIES, i * 0.618034f - floor(i * 0.618034f)));
        const float3 direction = q.x * x + q.y * y + sqrt(fmax(1.0f - dot(q, q), 0.0f)) * r.normal;
        if (dot(direction, r.geometric) <= 0.0f)
            continue;
        const float3 p = start_in_texel(&rays, &r, place_of_sample(i, (uint2)(0)));
        sum += transmittance(&rays, p + start_of(&r, p, direction), direction, reach * r.size);
        tried += 1.0f;
    }
    open[patch] = tried > 0.0f ? sum / tried : 0.0f;
}
