#version 430
// Direct light at every patch: samples of emitters, each with a shadow ray. As kernels/direct/direct.cl without its
// shafts, which change no light.
#define RECEIVER_ACCESS readonly
#define STATE_WORDS 208
#define WALK_WORDS (4 * 32)  // of the walk, at the end of the state: shaders/direct/light_tree.glsl
#include "bvh_traversal.glsl"
#include "resumed.glsl"
#include "receiver.glsl"
#include "emitters.glsl"
#include "light_tree.glsl"
#include "irradiance_l1.glsl"
#include "texel_ray_origins.glsl"

layout(local_size_x = 64) in;
// Light and unshadowed luminance of each item, then the L1 of each.
layout(std430, binding = 7) writeonly buffer Results { vec4 results[]; };
uniform int start, end, root, budget, first_l1;
uniform uint seed;

// Early-out: after this many rays, or this fraction of an emitter's samples if that is more, an emitter that all
// of them or none has reached counts as seen whole or not at all.
#define TRIAL 24.0
#define TRIAL_FRACTION 0.375

// Parts of light that differ by less are the same, but for rounding.
#define SAME 1e-3

// Rounds of samples of an emitter whose rays bring different parts of its light: a penumbra, or a texel across an edge
// of a shadow.
#define ROUNDS 4

// The golden ratio's fraction of the range of integers, and patches along a curve through the texels that share
// emitters out among them.
#define GOLDEN 2654435769u
#define NEIGHBOURS 64u

// The transmittance of surfaces that counts for an emitter's light. Surfaces and the sky are gathered as well: both
// parts of their light come through alike.
int kind_of_rays(const int e)
{
    int kind = emitters[e].kind;
    return kind == SKY_MAP || (kind == TRIANGLE && emitters[e].triangle >= 0) ? BOUNCE : SHADOW;
}

// The fraction of a sample's light that reaches a point, on its way from a little above the surface to a
// little before the light: that may be a surface, too.
Fraction seen(const Receiver r, const vec3 p, const Sample s, const int kind)
{
    vec3 origin = ray_origin(r, p, s.direction);
    bool far = s.distance == INFINITY;
    vec3 way = far ? s.direction : s.distance * s.direction - origin;
    return transmittance(kind, p + origin, way, far ? INFINITY : 0.9998);
}

struct Sum {
    vec3 light;
    float unshadowed;  // its luminance if nothing cast a shadow
    L1 l1;             // of the light (irradiance_l1.glsl)
};

// Consecutive samples of one emitter. If it is of one radiance its light is known but for the shadows: samples
// only tell the fraction of it that comes through.
struct Run {
    int first, rounds;     // number of its first sample; how often its samples are drawn
    float expected;        // samples of a round
    float tried;           // shadow rays
    Fraction through;      // their sum of the parts of light that arrive
    Fraction least, most;  // of these parts
    Fraction shadowed;
    float unshadowed;
    L1 tilted;             // of the samples, times what is shadowed of each
    vec3 open;             // its whole light, mean over the texel
    Sum sum;               // of an emitter of other radiances
};

// Points of a texel along u and v where light that changes over it is computed.
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

// The work of an item so far.
int index, emitter;
vec2 span;
Run run;
Sum sum;

// The state of an item that has paused, at most 79 words.
void exchange_state()
{
    exchange(index);
    exchange(emitter);
    exchange(span);
    exchange(run.first);
    exchange(run.rounds);
    exchange(run.expected);
    exchange(run.tried);
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

// E/pi of emitters at each patch. Samples go to emitters by systematic resampling: in proportion to what
// they may bring, so that many emitters cost little more than one. Neighbours begin at even distances, steps of
// the golden ratio: together they give each emitter its share, a dim one, too. Go on until all is done or it is time to
// pause; return whether all is done.
bool sample_on(const Receiver r)
{
    uint key = hash(r.rank ^ hash(seed));
    float offset = unit_float(hash(r.rank / NEIGHBOURS ^ hash(seed + 1u)) + r.rank * GOLDEN);
    bool done = false;
    while (!done && steps < MAX_STEPS) {
        ++steps;
        if (index == budget || float(index) + offset >= span.x) {
            // Once more, along further points of the sequence, if only part of the rays arrived.
            if (!is_even(run) && run.rounds < ROUNDS) {
                ++run.rounds;
                index = run.first;
            } else {
                // After the last sample, too, come emitters that have one of their own.
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
        // A sample of an emitter's own takes none of the line. Of lights too bright for floats the span may be NaN.
        int number = index;
        if (index < budget && !(float(index) + offset >= span.x))
            ++index;
        if (emitter < 0)
            continue;
        bool even = emitters[emitter].uniform_ != 0;

        // Where all rays of a trial met, or none, the others of this emitter are spared.
        bool spared = run.tried >= max(TRIAL, TRIAL_FRACTION * span.y) && is_even(run);
        if (spared && even)
            continue;
        vec4 u = sample_point(uint(number + (run.rounds - 1) * budget), key);
        vec3 p = jittered_origin(r, u.zw);
        Sample s = sample_emitter(emitter, r, p, u.xy);
#ifdef TRANSMISSION
        // Only the part of a surface that stops rays shines.
        if (s.surface > 0)
            s.light *= smallest(opacity(s.surface - 1, s.weights, s.shines_front, BOUNCE));
#endif
        float cosine = dot(s.direction, r.normal), over = dot(s.direction, horizon_of(r, s.back));
        if (!(cosine > 0.0 && over > 0.0 && luminance(s.light) > 0.0))
            continue;
        vec3 brought = s.light * (cosine / span.y);
        Fraction visible = Fraction(1.0);
        if (spared) {
            visible = run.through / run.tried;
        } else if (emitters[emitter].casts_shadow != 0) {
            visible = seen(r, p, s, kind_of_rays(emitter));
            run.through += visible;
            run.tried += 1.0;
            run.least = min(run.least, visible);
            run.most = max(run.most, visible);
        }
        vec3 tilt = l1_of_direction(s.direction, r.normal);
        if (even) {
            run.unshadowed += luminance(brought);
            run.shadowed += luminance(brought) * visible;
            add_l1(run.tilted, vec3(luminance(brought) * visible), tilt);
        } else {
            run.sum.unshadowed += luminance(brought);
            run.sum.light += brought * visible;
            add_l1(run.sum.l1, brought * visible, tilt);
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

    // One place in the code for both ways of the state: drivers inline every call.
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
