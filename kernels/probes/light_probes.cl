#include "bvh_traversal.cl"
#include "receiver.cl"
#include "emitters.cl"
#include "emitter_rays.cl"
#include "light_tree.cl"
#include "probe_sh.cl"
#include "blockers.cl"
#include "uniform_light.cl"

// Direct light of probes by sampled shadow rays, with light selection by a light tree. SPHERE is defined: light counts
// from all directions, without a cosine.

// Early termination as in direct.cl: if the first TRIAL rays to an emitter, or this fraction of its samples if that is
// more, agree, the rest are assumed equal and not traced.
#define TRIAL 24.0f
#define TRIAL_FRACTION 0.375f
#define SAME 1e-3f

// Minimum number of rays to an emitter for shaft culling, as in direct.cl.
#define SHAFT_FROM 3.0f

// A light is narrow if the mean direction of its samples is at least this long. TRIAL samples of equal visibility are
// enough for a narrow light. The value belongs to a disk of 0.1 rad radius; its L2 then differs by 1 % (estimated).
#define NARROW_LENGTH 0.9975f

// State of consecutive samples of one emitter: all samples, traced rays, the sum and the extremes of their
// transmittances, the sums of directions and of light.
typedef struct {
    float taken, traced;
    Fraction through, least, most;
    float3 directions;
    ProbeLight light;
} Run;

Run start_run(void)
{
    const Run run = {.least = (Fraction)(1.0f)};
    return run;
}

// Returns true if the first samples are enough to represent an emitter. Images on surfaces need all samples.
bool is_narrow(const Run *run, __global const Emitter *e)
{
    const bool is_smooth = e->triangle < 0 || e->kind != TRIANGLE || e->uniform;
    return is_smooth && run->taken >= TRIAL && length(run->directions) > NARROW_LENGTH * run->taken;
}

void finish_run(const Run *run, const float samples, ProbeLight *sum)
{
    if (run->taken > 0.0f)
        for (int k = 0; k < BASIS; ++k)
            sum->of[k] += run->light.of[k] * (M_PI_F / samples);
}

// Returns the transmittance from a probe to a light sample. The ray ends just before the light, which may be a surface.
Fraction transmittance_to(const Rays *rays, const Blockers *blockers, const float3 at, const Sample *s, const int kind)
{
    const bool far = s->distance == INFINITY;
    const float3 way = far ? s->direction : s->distance * s->direction;
    const float distance = far ? INFINITY : 0.9998f;
#ifndef TRANSMISSION
    if (blockers->count != UNKNOWN_BLOCKERS)
        return shaft_is_clear(blockers, at, way, distance);
#endif
    return transmittance(rays, kind, at, way, distance);
}

// Finds the blockers between a probe and an emitter with a size: a triangle, or one around the disk of a point light.
void find_probe_blockers(const Rays *rays, __global const Emitter *e, const Receiver *r, Blockers *blockers)
{
    if (e->kind == TRIANGLE)
        find_triangle_blockers(rays, e, r, blockers);
    if (e->kind != POINT || !(e->radius > 0.0f))
        return;
    const float3 centre = vload3(0, e->position), to = centre - r->at;
    const float d2 = dot(to, to), radius = e->radius;
    if (!(d2 > 2.0f * radius * radius))
        return;
    const float widened = 2.0f * radius * (e->soft ? 1.0f : rsqrt(1.0f - radius * radius / d2));
    float3 x, y;
    basis(to * rsqrt(d2), &x, &y);
    const float3 edge1 = widened * (1.5f * x + 0.8660254f * y), edge2 = widened * (1.5f * x - 0.8660254f * y);
    find_blockers(rays, centre - widened * x, edge1, edge2, r, blockers);
}

// Computes the direct light of probes: 3 BASIS coefficients each.
__kernel void light_probes(RAYS_ARGUMENTS, __global const float4 *probes, __global const Emitter *emitters,
                           __global const LightNode *light_nodes, const int root,
                           __global const Modulation *modulations, __global const float *profiles, const int budget,
                           __global const float4 *radiance, __global const float4 *back_radiance,
                           __global const uint *texel_to_patch, __global const float2 *uvs, const int resolution,
                           __global const float4 *sky_pixels, __global const float *cumulative,
                           __global const int *listed, const int sky_width, const int sky_height, const int sky_count,
                           const float sky_total, const uint seed, __global float *coefficients, const int start,
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
    Run run = start_run();
    Blockers blockers = {UNKNOWN_BLOCKERS};
    int emitter = -1, step;
    for (int index = 0; total > 0.0f; index += step) {
        if (index == budget || index + offset >= span.x) {
            finish_run(&run, span.y, &sum);
            emitter = next_emitter(&walk, &lights, &r, index == budget ? INFINITY : index + offset, &span);
            if (index == budget && emitter < 0)
                break;
            run = start_run();
            blockers.count = UNKNOWN_BLOCKERS;
            if (emitter >= 0 && emitters[emitter].casts_shadow && span.y >= SHAFT_FROM)
                find_probe_blockers(&rays, emitters + emitter, &r, &blockers);
        }
        // Samples that belong to one emitter do not advance the sequence that all emitters share.
        step = index < budget && !(index + offset >= span.x);
        if (emitter < 0)
            continue;
        __global const Emitter *e = emitters + emitter;
        const bool clear = blockers.count == 0 || !e->casts_shadow;
        const bool is_skipped =
            run.traced >= fmax(TRIAL, TRIAL_FRACTION * span.y) && largest(run.most - run.least) < SAME;
        if (clear || is_skipped) {
            const Fraction known = clear ? (Fraction)(1.0f) : run.through / run.traced;
            const bool is_exact = add_constant(&sum, e, r.at, known / fmin(span.y, 1.0f));
            const bool is_enough = !is_exact && is_narrow(&run, e);
            if (is_enough)
                finish_run(&run, run.taken, &sum);
            if (is_exact || is_enough) {
                run.taken = 0.0f;
                while (step > 0 && index + step < budget && index + step + offset < span.x)
                    ++step;
                continue;
            }
        }
        const float4 u = sample_point(index, key);
        Sample s = sample_emitter(e, &glow, &sky, &lights.modulations, &r, r.at, u.xy);
        run.taken += 1.0f;
#ifdef TRANSMISSION
        // Only the opaque fraction of a surface emits.
        if (s.surface > 0)
            s.light *= smallest(opacity(&rays, s.surface - 1, s.weights, s.shines_front, BOUNCE, s.steepness));
#endif
        if (!(luminance(s.light) > 0.0f))
            continue;
        Fraction visible = (Fraction)(1.0f);
        if (!clear && is_skipped) {
            visible = run.through / run.traced;
        } else if (!clear) {
            visible = transmittance_to(&rays, &blockers, r.at, &s, kind_of_rays(e));
            run.through += visible;
            run.traced += 1.0f;
            run.least = fmin(run.least, visible);
            run.most = fmax(run.most, visible);
        }
        add_direction(&run.light, s.direction, s.light * visible);
        run.directions += s.direction;
    }
    for (int k = 0; k < BASIS; ++k)
        vstore3(sum.of[k], BASIS * (size_t)probe + k, coefficients);
}
