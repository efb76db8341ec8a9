// Hits of samples that are traced before the sources of light are known: the index of a texel, with the BACK bit for
// back faces, or SKY. Surfaces must not tint light.
#define HITS
#include "trace_sample.cl"

uint stored_hit(const Lightmaps *lightmaps, const Hit hit)
{
    if (hit.triangle < 0)
        return SKY;
    const Hit shown = turned(lightmaps, hit);
    return (uint)texel_of_hit(lightmaps, shown) | (shown.front ? 0u : BACK);
}

// Returns the item-buffer entry of a stored hit, like `sample_of_hit`.
uint entry_of_hit(const Lightmaps *lightmaps, const uint hit)
{
    return hit == SKY ? SKY : lightmaps->texel_to_patch[hit & ~BACK] | (hit & BACK);
}

#include "trace_visibility.cl"

// Traces the samples of one patch per work group, with the rays of `trace_visibility`; samples below the horizon have no
// ray.
__kernel void trace_hits(LOOK_ARGUMENTS, const int start, __global uint *hits, const int hits_from)
{
    const int patch = start + get_group_id(0);
    const Rays rays = RAYS;
    const Lightmaps lightmaps = {uvs, atlases, texel_to_patch, resolution, backs};
    const Receiver receiver = load_receiver(receivers + patch);
    const View view = view_of(&receiver, patch, samples, salt, rotate);
    Eye eye = {view.eye, -1};
    for (int i = get_local_id(0); i < samples; i += get_local_size(0)) {
        const float3 direction = sample_direction(&view, i, pattern, n);
        if (dot(direction, view.horizon) <= 0.0f)
            continue;
        advance_origin(&eye, &view, &rays, &receiver, i, samples);
        hits[(size_t)(patch - hits_from) * samples + i] =
            stored_hit(&lightmaps, nearest_hit(&rays, eye.at, direction, false));
    }
}
