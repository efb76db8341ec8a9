#version 430
// Computes direct irradiance of patches by sampled shadow rays. The same algorithm as kernels/direct/direct.cl, but
// without shaft culling, which does not change the result.
#define RECEIVER_ACCESS readonly
#define STATE_WORDS 208
#define WALK_WORDS (4 * 32)  // words of the tree descent, at the end of the state (light_tree.glsl)
#include "bvh_traversal.glsl"
#include "resumed.glsl"
#include "receiver.glsl"
#include "emitters.glsl"
#include "light_tree.glsl"
#include "irradiance_l1.glsl"
#include "texel_ray_origins.glsl"

layout(local_size_x = 64) in;
// Irradiance, and its luminance without shadows, of each item; then the L1 of each item.
layout(std430, binding = 7) writeonly buffer Results { vec4 results[]; };
uniform int start, end, root, budget, first_l1;
uniform uint seed;

// Early termination: if the first TRIAL rays to an emitter, or this fraction of its samples if that is more, are all
// unoccluded or all blocked, the rest are assumed equal and not traced.
#define TRIAL 24.0
#define TRIAL_FRACTION 0.375

// Tolerance at which visibility values count as equal; covers rounding.
#define SAME 1e-3

// Number of sampling rounds for an emitter that is partly visible (penumbra, or shadow edge within the texel).
#define ROUNDS 4

// GOLDEN: golden ratio - 1 as a fraction of 2^32. Consecutive patches along the Hilbert curve share one stratified
// distribution of emitters; the second value is their number.
#define GOLDEN 2654435769u
#define NEIGHBOURS 64u

// Returns which transmittance applies to an emitter's light. Emissive surfaces and the sky are also gathered as
// indirect light, so they use BOUNCE, for equal attenuation of both parts.
int kind_of_rays(const int e)
{
    int kind = emitters[e].kind;
    return kind == SKY_MAP || (kind == TRIANGLE && emitters[e].triangle >= 0) ? BOUNCE : SHADOW;
}

// Returns the transmittance from a point to a light sample. The ray starts just above the surface and ends just before
// the light, which may be a surface itself.
Fraction transmittance_to(const Receiver r, const vec3 p, const Sample s, const int kind)
{
    vec3 origin = ray_origin(r, p, s.direction);
    bool far = s.distance == INFINITY;
    vec3 way = far ? s.direction : s.distance * s.direction - origin;
    return transmittance(kind, p + origin, way, far ? INFINITY : 0.9998);
}

struct Sum {
    vec3 light;
    float unshadowed;  // luminance without shadows
    L1 l1;             // of the light (irradiance_l1.glsl)
};

// Accumulates consecutive samples of one emitter. If its radiance is uniform, its unoccluded irradiance is computed
// analytically, and samples estimate only the visible fraction (ratio estimator).
struct Run {
    int first, rounds;     // index of the first sample; number of sampling rounds
    float expected;        // samples per round
    float traced;          // shadow rays traced
    Fraction through;      // sum of their transmittances
    Fraction least, most;  // extremes of these
    Fraction shadowed;
    float unshadowed;
    L1 tilted;             // sum of L1 times visible luminance
    vec3 open;             // unoccluded irradiance, mean over the texel
    Sum sum;               // used for non-uniform emitters
};

// Points per axis of a grid in the texel, at which irradiance without shadow is averaged if it varies over the texel.
#define GRID 4

vec3 open_over_texel(const int e, const Receiver r)
{
    bool far = is_far(e, r);
    int points = far ? 1 : GRID * GRID;
    vec3 sum = vec3(0.0);
    for (int i = 0; i < points; ++i) {
        vec3 p = r.at;
        if (!far)
            p = jittered_origin(r, vec2(float(i % GRID) + 0.5, float(i / GRID) + 0.5) / float(GRID));
        sum += open_light(e, p, r);
    }
    return sum / float(points);
}

Sum no_light() { return Sum(vec3(0.0), 0.0, L1(vec3(0.0), vec3(0.0), vec3(0.0))); }

Run start_run(const int first, const float expected)
{
    L1 none = L1(vec3(0.0), vec3(0.0), vec3(0.0));
    return Run(first, 1, expected, 0.0, Fraction(0.0), Fraction(1.0), Fraction(0.0), Fraction(0.0), 0.0, none,
               vec3(0.0), no_light());
}

bool is_even(const Run run) { return largest(run.most - run.least) < SAME; }

// Returns true if an emitter needs another sampling round: its rays disagree, or few of them met the cone of an area
// light with a spread. Few rays are often all blocked where a little light arrives, and ending there would bias it.
bool needs_round(const Run run, const int e)
{
    float enough = min(run.expected, max(TRIAL, TRIAL_FRACTION * run.expected));
    return run.rounds < ROUNDS && (!is_even(run) || (has_spread(e) && run.traced < enough));
}

void add_scaled(inout L1 l1, const vec3 scale, const L1 added)
{
#ifdef DIRECTIONAL
    l1.x += scale * added.x;
    l1.y += scale * added.y;
    l1.z += scale * added.z;
#endif
}

void finish_run(const Run run, inout Sum sum)
{
    float part = 1.0 / float(run.rounds);
    sum.light += part * run.sum.light;
    sum.unshadowed += part * run.sum.unshadowed;
    add_scaled(sum.l1, vec3(part), run.sum.l1);
    if (!(run.unshadowed > 0.0))
        return;
    vec3 open = run.open / min(run.expected, 1.0);
    sum.light += open * (run.shadowed / run.unshadowed);
    add_scaled(sum.l1, open / run.unshadowed, run.tilted);
    sum.unshadowed += luminance(open);
}

void exchange(inout L1 l1)
{
#ifdef DIRECTIONAL
    exchange(l1.x);
    exchange(l1.y);
    exchange(l1.z);
#endif
}

void exchange(inout Sum sum)
{
    exchange(sum.light);
    exchange(sum.unshadowed);
    exchange(sum.l1);
}

// Progress of a work item.
int index, emitter;
vec2 span;
Run run;
Sum sum;

// Stores or loads the state of an item, at most 79 words, when it pauses or resumes.
void exchange_state()
{
    exchange(index);
    exchange(emitter);
    exchange(span);
    exchange(run.first);
    exchange(run.rounds);
    exchange(run.expected);
    exchange(run.traced);
    exchange(run.through);
    exchange(run.least);
    exchange(run.most);
    exchange(run.shadowed);
    exchange(run.unshadowed);
    exchange(run.tilted);
    exchange(run.open);
    exchange(run.sum);
    exchange(sum);
    int counts = int(walk_counts);
    exchange(counts);
    walk_counts = counts != 0;
    exchange(walk_depth);
    exchange(walk_total);
    exchange(walk_scale);
    exchange(walk_passed);
    exchange(walk_visits);
    exchange(walk_own);
}

// Computes direct irradiance (E/pi) of a patch. Samples are allotted to emitters by systematic resampling, in
// proportion to their estimated irradiance, so that many emitters cost little more than one. Sequences of neighbouring
// patches are offset by the golden ratio: together they sample weak emitters evenly, too. Returns true if all samples
// are done, false if the item has paused.
bool sample_on(const Receiver r)
{
    uint key = hash(r.rank ^ hash(seed));
    float offset = unit_float(hash(r.rank / NEIGHBOURS ^ hash(seed + 1u)) + r.rank * GOLDEN);
    bool done = false;
    while (!done && steps < MAX_STEPS) {
        ++steps;
        if (index == budget || float(index) + offset >= span.x) {
            // Another round takes further points of the sequence.
            if (emitter >= 0 && needs_round(run, emitter)) {
                ++run.rounds;
                index = run.first;
            } else {
                // After the last sample of the sequence, emitters with a sample of their own remain.
                finish_run(run, sum);
                emitter = next_emitter(r, root, budget, index == budget ? INFINITY : float(index) + offset, span);
                if (index == budget && emitter < 0) {
                    done = true;
                    continue;
                }
                run = start_run(index, span.y);
                if (emitter >= 0 && emitters[emitter].uniform_ != 0)
                    run.open = open_over_texel(emitter, r);
            }
        }
        // A sample that an emitter gets by itself does not advance the common sequence. For lights too bright for
        // float32 the span may be NaN.
        int number = index;
        if (index < budget && !(float(index) + offset >= span.x))
            ++index;
        if (emitter < 0)
            continue;
        bool even = emitters[emitter].uniform_ != 0;

        // Skip the remaining rays of an emitter if all rays so far agree (see TRIAL).
        bool is_skipped = run.traced >= max(TRIAL, TRIAL_FRACTION * span.y) && is_even(run);
        if (is_skipped && even)
            continue;
        vec4 u = sample_point(uint(number + (run.rounds - 1) * budget), key);
        vec3 p = jittered_origin(r, u.zw);
        Sample s = sample_emitter(emitter, r, p, u.xy);
#ifdef TRANSMISSION
        // Only the opaque fraction of a surface emits.
        if (s.surface > 0)
            s.light *= smallest(opacity(s.surface - 1, s.weights, s.shines_front, BOUNCE, s.steepness));
#endif
        float cosine = dot(s.direction, r.normal), over = dot(s.direction, horizon_of(r, s.back));
        if (!(cosine > 0.0 && over > 0.0 && luminance(s.light) > 0.0))
            continue;
        vec3 unoccluded = s.light * (cosine / span.y);
        Fraction visible = Fraction(1.0);
        if (is_skipped) {
            visible = run.through / run.traced;
        } else if (emitters[emitter].casts_shadow != 0) {
            visible = transmittance_to(r, p, s, kind_of_rays(emitter));
            run.through += visible;
            run.traced += 1.0;
            run.least = min(run.least, visible);
            run.most = max(run.most, visible);
        }
        vec3 tilt = l1_of_direction(s.direction, r.normal);
        if (even) {
            run.unshadowed += luminance(unoccluded);
            run.shadowed += luminance(unoccluded) * visible;
            add_l1(run.tilted, vec3(luminance(unoccluded) * visible), tilt);
        } else {
            run.sum.unshadowed += luminance(unoccluded);
            run.sum.light += unoccluded * visible;
            add_l1(run.sum.l1, unoccluded * visible, tilt);
        }
    }
    return done;
}

void main()
{
    int item = start + int(gl_GlobalInvocationID.x);
    if (item >= end)
        return;
    int slot = item - start;
    uint state = begin_state(slot, false);
    if (state == 2u)
        return;
    walk_first = 1 + STATE_WORDS * (slot + 1) - WALK_WORDS;
    if (state == 0u)
        start_walk(root, budget);
    index = 0;
    emitter = -1;
    span = vec2(0.0);
    run = start_run(0, 0.0);
    sum = no_light();

    // The same call stores and loads the state, because drivers inline every call.
    for (int turn = 0; turn < 2; ++turn) {
        if (turn == 1 || state == 1u)
            exchange_state();
        if (turn == 0) {
            bool done = sample_on(load_receiver(item));
            begin_state(slot, true);
            end_state(slot, done);
        }
    }
    results[item] = vec4(sum.light, sum.unshadowed);
#ifdef DIRECTIONAL
    results[first_l1 + 3 * item] = vec4(sum.l1.x, 0.0);
    results[first_l1 + 3 * item + 1] = vec4(sum.l1.y, 0.0);
    results[first_l1 + 3 * item + 2] = vec4(sum.l1.z, 0.0);
#endif
}
