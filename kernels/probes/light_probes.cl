#include "bvh_traversal.cl"
#include "receiver.cl"
#include "emitters.cl"
#include "emitter_rays.cl"
#include "light_tree.cl"
#include "probe_sh.cl"

// Direct light of probes by sampled shadow rays, with light selection by a light tree. SPHERE is defined: light counts
// from all directions, without a cosine.

// Early termination as in direct.cl: if the first TRIAL rays to an emitter, or this fraction of its samples if that is
// more, agree, the rest are assumed equal and not traced.
#define TRIAL 24.0f
#define TRIAL_FRACTION 0.375f
#define SAME 1e-3f

// State of consecutive samples of one emitter: traced rays, the sum and the extremes of their transmittances.
typedef struct {
    float traced;
    Fraction through, least, most;
} Run;

// Adds direct light to the coefficients of probes: BASIS float4 each.
__kernel void light_probes(RAYS_ARGUMENTS, __global const float4 *probes, __global const Emitter *emitters,
                           __global const LightNode *light_nodes, const int root,
                           __global const Modulation *modulations, __global const float *profiles, const int budget,
                           __global const float4 *radiance, __global const float4 *back_radiance,
                           __global const uint *texel_to_patch, __global const float2 *uvs, const int resolution,
                           __global const float4 *sky_pixels, __global const float *cumulative,
                           __global const int *listed, const int sky_width, const int sky_height, const int sky_count,
                           const float sky_total, const uint seed, __global float4 *coefficients, const int start,
                           const int end)
{
    const int probe = start + get_global_id(0);
    if (probe >= end)
        return;
    const Rays rays = RAYS;
    const Lights lights = {emitters, light_nodes, sky_total, {modulations, profiles}};
    const Glow glow = {radiance, back_radiance, texel_to_patch, uvs, resolution};
    const Bright sky = {sky_pixels, cumulative, listed, sky_width, sky_height, sky_count, sky_total};
    Receiver r = {.at = probes[probe].xyz};

    const uint key = hash((uint)probe ^ hash(seed));
    const float offset = unit_float(hash(key ^ 0x51ed270bu));
    Walk walk;
    const float total = start_walk(&walk, &lights, root, &r, budget);
    float2 span = (float2)(0.0f);
    ProbeLight sum = {{(float3)(0.0f)}};
    Run run = {0.0f, (Fraction)(0.0f), (Fraction)(1.0f), (Fraction)(0.0f)};
    int emitter = -1, step;
    for (int index = 0; total > 0.0f; index += step) {
        if (index == budget || index + offset >= span.x) {
            emitter = next_emitter(&walk, &lights, &r, index == budget ? INFINITY : index + offset, &span);
            if (index == budget && emitter < 0)
                break;
            run = (Run){0.0f, (Fraction)(0.0f), (Fraction)(1.0f), (Fraction)(0.0f)};
        }
        // Samples that belong to one emitter do not advance the sequence that all emitters share.
        step = index < budget && !(index + offset >= span.x);
        if (emitter < 0)
            continue;
        __global const Emitter *e = emitters + emitter;
        const float4 u = sample_point(index, key);
        Sample s = sample_emitter(e, &glow, &sky, &lights.modulations, &r, r.at, u.xy);
#ifdef TRANSMISSION
        // Only the opaque fraction of a surface emits.
        if (s.surface > 0)
            s.light *= smallest(opacity(&rays, s.surface - 1, s.weights, s.shines_front, BOUNCE, s.steepness));
#endif
        if (!(luminance(s.light) > 0.0f))
            continue;
        Fraction visible = (Fraction)(1.0f);
        if (run.traced >= fmax(TRIAL, TRIAL_FRACTION * span.y) && largest(run.most - run.least) < SAME) {
            visible = run.through / run.traced;
        } else if (e->casts_shadow) {
            const bool far = s.distance == INFINITY;
            visible = transmittance(&rays, kind_of_rays(e), r.at, far ? s.direction : s.distance * s.direction,
                                    far ? INFINITY : 0.9998f);
            run.through += visible;
            run.traced += 1.0f;
            run.least = fmin(run.least, visible);
            run.most = fmax(run.most, visible);
        }
        add_direction(&sum, s.direction, s.light * visible * (M_PI_F / span.y));
    }
    __global float4 *own = coefficients + BASIS * (size_t)probe;
    for (int k = 0; k < BASIS; ++k)
        own[k].xyz += sum.of[k];
}
