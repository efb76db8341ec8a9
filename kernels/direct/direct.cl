#include "bvh_traversal.cl"
#include "receiver.cl"
#include "emitters.cl"
#include "emitter_rays.cl"
#include "light_tree.cl"
#include "irradiance_l1.cl"
#include "texel_ray_origins.cl"
#include "shaft.cl"
#include "blockers.cl"

// Direct lighting of patches by sampled shadow rays, with light selection by a light tree (light_tree.cl).

// Early termination: if the first TRIAL rays to an emitter, or this fraction of its samples if that is more, are all
// unoccluded or all blocked, the rest are assumed equal and not traced.
#define TRIAL 24.0f
#define TRIAL_FRACTION 0.375f

// Tolerance at which visibility values count as equal; covers rounding.
#define SAME 1e-3f

// Maximum number of sampling rounds for an emitter that is partly visible (penumbra, or shadow edge within the texel).
// Almost all noise of direct light arises there.
#define ROUNDS 4

// Minimum number of rays to an emitter for shaft culling; for fewer, tracing them is faster (measured).
#define SHAFT_FROM 3.0f

// NEIGHBOURS: number of consecutive patches along the Hilbert curve that share one stratified distribution of emitters.
// GOLDEN: golden ratio - 1 as a fraction of 2^32, the step between their offsets.
#define GOLDEN 2654435769u
#define NEIGHBOURS 64

// Returns the transmittance from a point p to a light sample. The ray starts just above the surface and ends just
// before the light, which may be a surface itself.
Fraction transmittance_to(const Rays *rays, const Blockers *blockers, const Receiver *r, const float3 p,
                          const Sample *s, const int kind)
{
    const float3 start = ray_origin(r, p, s->direction);
    const bool far = s->distance == INFINITY;
    const float3 way = far ? s->direction : s->distance * s->direction - start;
    const float distance = far ? INFINITY : 0.9998f;
#ifndef TRANSMISSION
    if (blockers->count != UNKNOWN_BLOCKERS)
        return shaft_is_clear(blockers, p + start, way, distance);
#endif
    return transmittance(rays, kind, p + start, way, distance);
}

typedef struct {
    float3 light;
    float unshadowed;  // luminance without shadows
    L1 l1;             // of the light (irradiance_l1.cl)
} Sum;

// Accumulates consecutive samples of one emitter. If its radiance is uniform, its unoccluded irradiance is computed
// analytically, and samples estimate only the visible fraction (ratio estimator).
typedef struct {
    int first, rounds;     // index of the first sample; number of sampling rounds
    float expected;        // samples per round
    float traced;          // shadow rays traced
    Fraction through;      // sum of their transmittances
    Fraction least, most;  // extremes of these
    Fraction shadowed;
    float unshadowed;
#ifdef TINTED
    L1 tilted;  // sum of L1 times visible luminance
#else
    float3 tilted;  // sum of l1_of_direction times visible luminance
#endif
    float3 open;  // unoccluded irradiance, mean over the texel
    Sum sum;      // used for non-uniform emitters
} Run;

// Points per axis of a grid in the texel, at which irradiance without shadow is averaged if it varies over the texel.
#define GRID 4

float3 open_over_texel(const Rays *rays, __global const Emitter *e, const Receiver *r)
{
    if (is_far(e, r))
        return open_light(e, r->at, r);
    float3 sum = (float3)(0.0f);
    for (int i = 0; i < GRID * GRID; ++i) {
        const float2 at = (float2)(i % GRID + 0.5f, i / GRID + 0.5f) / GRID;
        sum += open_light(e, jittered_origin(rays, r, at), r);
    }
    return sum / (GRID * GRID);
}

Run start_run(const int first, const float expected)
{
    const Run run = {.first = first, .rounds = 1, .expected = expected, .least = (Fraction)(1.0f)};
    return run;
}

// Adds the L1 of a finished run. light: irradiance of the emitter per unit of sample luminance.
void add_tilted(L1 *l1, const float3 light, const Run *run)
{
#ifdef TINTED
    l1->x.xyz += light * run->tilted.x.xyz;
    l1->y.xyz += light * run->tilted.y.xyz;
    l1->z.xyz += light * run->tilted.z.xyz;
#else
    add_l1(l1, light, run->tilted);
#endif
}

bool is_even(const Run *run) { return largest(run->most - run->least) < SAME; }

// Returns true if an emitter needs another sampling round: its rays disagree, or few of them met the cone of an area
// light with a spread. Few rays are often all blocked where a little light arrives, and ending there would bias it.
bool needs_round(const Run *run, __global const Emitter *e)
{
    const float enough = fmin(run->expected, fmax(TRIAL, TRIAL_FRACTION * run->expected));
    return run->rounds < ROUNDS && (!is_even(run) || (has_spread(e) && run->traced < enough));
}

void finish_run(const Run *run, Sum *sum)
{
    const float part = 1.0f / run->rounds;
    sum->light += part * run->sum.light;
    sum->unshadowed += part * run->sum.unshadowed;
#ifdef DIRECTIONAL
    sum->l1.x += part * run->sum.l1.x;
    sum->l1.y += part * run->sum.l1.y;
    sum->l1.z += part * run->sum.l1.z;
#endif
    if (!(run->unshadowed > 0.0f))
        return;
    const float3 open = run->open / fmin(run->expected, 1.0f);
    sum->light += open * (run->shadowed / run->unshadowed);
    add_tilted(&sum->l1, open / run->unshadowed, run);
    sum->unshadowed += luminance(open);
}

// Computes direct irradiance (E/pi) of patches. Samples are allotted to emitters by systematic resampling, in
// proportion to their estimated irradiance, so that many emitters cost little more than one. Sequences of neighbouring
// patches are offset by the golden ratio: together they sample weak emitters evenly, too. result: rgb irradiance; a is
// its luminance without shadows. l1 (with DIRECTIONAL): three float4 per patch. chosen: patch indices, or null for all.
__kernel void sample_direct_light(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers,
                                  __global const Emitter *emitters, __global const LightNode *light_nodes,
                                  const int root, __global const Modulation *modulations,
                                  __global const float *profiles, const int budget, __global const float4 *radiance,
                                  __global const float4 *back_radiance, __global const uint *texel_to_patch,
                                  __global const float2 *uvs, const int resolution, __global const float4 *sky_pixels,
                                  __global const float *cumulative, __global const int *listed, const int sky_width,
                                  const int sky_height, const int sky_count, const float sky_total, const uint seed,
                                  __global float4 *l1, __global const int *chosen, __global float4 *result,
                                  const int start, const int end)
{
    const int item = start + get_global_id(0);
    if (item >= end)
        return;
    const int patch = chosen ? chosen[item] : item;
    const Rays rays = RAYS;
    const Lights lights = {emitters, light_nodes, sky_total, {modulations, profiles}};
    const Glow glow = {radiance, back_radiance, texel_to_patch, uvs, resolution};
    const Bright sky = {sky_pixels, cumulative, listed, sky_width, sky_height, sky_count, sky_total};
    const Receiver r = load_receiver(receivers + patch);

    const uint key = hash(r.rank ^ hash(seed));
    const float offset = unit_float(hash(r.rank / NEIGHBOURS ^ hash(seed + 1u)) + r.rank * GOLDEN);
    Walk walk;
    const float total = start_walk(&walk, &lights, root, &r, budget);
    float2 span = (float2)(0.0f);
    Sum sum = {(float3)(0.0f)};
    Run run = start_run(0, 0.0f);
    Blockers blockers = {UNKNOWN_BLOCKERS};
    int emitter = -1;
    int step;
    for (int index = 0; total > 0.0f; index += step) {
        if (index == budget || index + offset >= span.x) {
            // Another round takes further points of the sequence.
            if (emitter >= 0 && needs_round(&run, emitters + emitter)) {
                ++run.rounds;
                index = run.first;
            } else {
                // After the last sample of the sequence, emitters with a sample of their own remain.
                finish_run(&run, &sum);
                emitter = next_emitter(&walk, &lights, &r, index == budget ? INFINITY : index + offset, &span);
                if (index == budget && emitter < 0)
                    break;
                run = start_run(index, span.y);
                blockers.count = UNKNOWN_BLOCKERS;
                if (emitter >= 0 && emitters[emitter].uniform) {
                    run.open = open_over_texel(&rays, emitters + emitter, &r);
                    if (emitters[emitter].casts_shadow && span.y >= SHAFT_FROM)
                        find_triangle_blockers(&rays, emitters + emitter, &r, &blockers);
                }
            }
        }
        // A sample that an emitter gets by itself does not advance the common sequence. For lights too bright for
        // float32 the span may be NaN.
        step = index < budget && !(index + offset >= span.x);
        if (emitter < 0)
            continue;
        __global const Emitter *e = emitters + emitter;

#ifndef DIRECTIONAL
        // No geometry in the shaft: the analytic irradiance is exact.
        if (blockers.count == 0) {
            run.shadowed = (Fraction)(1.0f);
            run.unshadowed = 1.0f;
            continue;
        }
#endif

        // Skip the remaining rays of an emitter if all rays so far agree (see TRIAL).
        const bool is_skipped = run.traced >= fmax(TRIAL, TRIAL_FRACTION * span.y) && is_even(&run);
        if (is_skipped && e->uniform)
            continue;
        const float4 u = sample_point(index + (run.rounds - 1) * budget, key);
        const float3 p = jittered_origin(&rays, &r, u.zw);
        Sample s = sample_emitter(e, &glow, &sky, &lights.modulations, &r, p, u.xy);
#ifdef TRANSMISSION
        // Only the opaque fraction of a surface emits.
        if (s.surface > 0)
            s.light *= smallest(opacity(&rays, s.surface - 1, s.weights, s.shines_front, BOUNCE, s.steepness));
#endif
        const float cosine = dot(s.direction, r.normal);
        const float over = dot(s.direction, horizon_of(&r, s.back));
        if (!(cosine > 0.0f && over > 0.0f && luminance(s.light) > 0.0f))
            continue;
        const float3 unoccluded = s.light * (cosine / span.y);
        Fraction visible = (Fraction)(1.0f);
        if (is_skipped) {
            visible = run.through / run.traced;
        } else if (e->casts_shadow) {
            if (blockers.count != 0)
                visible = transmittance_to(&rays, &blockers, &r, p, &s, kind_of_rays(e));
            run.through += visible;
            run.traced += 1.0f;
            run.least = fmin(run.least, visible);
            run.most = fmax(run.most, visible);
        }
        const float3 tilt = l1_of_direction(s.direction, r.normal);
        if (e->uniform) {
            run.unshadowed += luminance(unoccluded);
            run.shadowed += luminance(unoccluded) * visible;
#ifdef TINTED
            add_l1(&run.tilted, luminance(unoccluded) * visible, tilt);
#else
            run.tilted += luminance(unoccluded) * visible * tilt;
#endif
        } else {
            run.sum.unshadowed += luminance(unoccluded);
            run.sum.light += unoccluded * visible;
            add_l1(&run.sum.l1, unoccluded * visible, tilt);
        }
    }
    result[item] = (float4)(sum.light, sum.unshadowed);
#ifdef DIRECTIONAL
    l1[3 * (size_t)item] = sum.l1.x;
    l1[3 * (size_t)item + 1] = sum.l1.y;
    l1[3 * (size_t)item + 2] = sum.l1.z;
#endif
}
