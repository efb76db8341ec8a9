#include "bvh_traversal.cl"
#include "receiver.cl"
#include "trace_sample.cl"
#include "probe_sh.cl"

// Visibility of probes: the item-buffer entry that each direction of a probe hits.

// Fills one row of samples per probe, one work group per probe. probes: position, metres, and in w the distance by
// which rays start behind it: a probe in the plane of a surface then hits its back, not what lies beyond. tint_rows:
// palette index of each sample, with TINTED. distances: from the probe to the hit of each sample, metres; null if they
// are not needed. uv_sizes: metres per unit of UV of each triangle, or null.
__kernel void trace_probes(RAYS_ARGUMENTS, __global const float2 *uvs, __global const int *atlases,
                           __global const uint *texel_to_patch, const int resolution, __global const int *backs,
                           __global const float *uv_sizes, __global const float4 *probes,
                           __global const float4 *rotations, __global const float4 *directions, const int samples,
                           const int start, __global uint *rows, __global uchar *tint_rows, __global float *distances)
{
    const int probe = start + get_group_id(0);
    const Rays rays = RAYS;
    const Lightmaps lightmaps = {uvs, atlases, texel_to_patch, resolution, backs};
    const float4 at = probes[probe], rotation = rotations[probe];
    for (int i = get_local_id(0); i < samples; i += get_local_size(0)) {
        const float3 direction = rotated(rotation, directions[i].xyz);
        const size_t place = (size_t)probe * samples + i;
        const float3 origin = at.xyz - at.w * direction;
        const Hit hit = nearest_hit(&rays, origin, direction, false);
        uint tint;
        const bool is_near = uv_sizes && hit.triangle >= 0 && !hit.front
            && hit.distance < LIT_FROM * uv_sizes[hit.triangle] / resolution;
        rows[place] = sample_of_hit(&rays, &lightmaps, origin, direction, hit, &tint) | (is_near ? NEAR_BACK : 0u);
        if (distances)
            distances[place] = hit.triangle < 0 ? INFINITY : fmax(hit.distance - at.w, 0.0f);
#ifdef TINTED
        tint_rows[place] = tint;
#endif
    }
}

// Stores the vector from each chosen probe to the nearest back face that its directions hit; 0 if they hit none.
__kernel void find_way_out(RAYS_ARGUMENTS, __global const float4 *probes, __global const float4 *rotations,
                           __global const float4 *directions, const int samples, __global const int *chosen,
                           __global float4 *ways, const int count)
{
    const int item = get_global_id(0);
    if (item >= count)
        return;
    const Rays rays = RAYS;
    const float4 at = probes[chosen[item]], rotation = rotations[chosen[item]];
    float nearest = INFINITY;
    float3 way = (float3)(0.0f);
    for (int i = 0; i < samples; ++i) {
        const float3 direction = rotated(rotation, directions[i].xyz);
        const Hit hit = nearest_hit(&rays, at.xyz - at.w * direction, direction, false);
        if (hit.triangle >= 0 && !hit.front && hit.distance < nearest) {
            nearest = hit.distance;
            way = fmax(hit.distance - at.w, 0.0f) * direction;
            if (!any(way != 0.0f))
                way = 1e-6f * at.w * direction;
        }
    }
    ways[item] = (float4)(way, nearest);
}
