// The fraction of each patch's hemisphere, weighted by the cosine, in which nothing is nearer than `reach`.
__kernel void occlusion(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, const int budget, const float reach,
                        const uint seed, __global float4 *result, const int start, const int end)
{
    const int patch = start + get_global_id(0);
    if (patch >= end)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + patch);
    float3 x, y;
    basis(r.normal, &x, &y);
    float open = 0.0f, all = 0.0f;
    const uint key = hash((uint)patch ^ hash(seed));
    for (int i = 0; i < budget; ++i) {
        const float4 u = sample_point(i, key);
        const float2 q = disk(u.xy);
        const float3 direction = q.x * x + q.y * y + sqrt(fmax(1.0f - dot(q, q), 0.0f)) * r.normal;
        if (dot(direction, r.geometric) <= 0.0f)
            continue;
        const float3 p = start_in_texel(&rays, &r, u.zw), origin = p + start_of(&r, p, direction);
        open += transmittance(&rays, origin, direction, reach);
        all += 1.0f;
    }
    result[patch] = (float4)((float3)(all > 0.0f ? open / all : 0.0f), 0.0f);
}
