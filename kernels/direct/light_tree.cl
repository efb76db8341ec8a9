#pragma once
#include "receiver.cl"
#include "modulation.cl"
#include "emitters.cl"

// A tree over emitters (engine/direct/light_tree.py), and the way of a patch's samples down to emitters.

#define TREE_STACK 32  // the tree is balanced: enough for 2^31 emitters

// A node is taken as one light if its radius is less than this part of the distance (Barnes and Hut 1986).
#define OPENING 0.4f

// An emitter nearby, of one radiance, that expects at least this many samples but less than one has one of its own, not
// by lot: its light is known but for the shadow, and would be noise. These are at most a part of a patch's samples.
#define OWN_SAMPLE 0.1f
#define PART_OF_OWN 0.25f

typedef struct {
    __global const Emitter *emitters;
    __global const LightNode *nodes;
    float sky_total;
    Modulations modulations;
} Lights;

// About how much light all emitters of an inner node bring without shadow; 0 only if they bring none.
// `open` is set if the node is too near to be taken as one light.
float node_weight(__global const LightNode *node, const Receiver *r, bool *open)
{
    const float3 to = vload3(0, node->centre) - r->at;
    const float radius = node->radius, extent = radius + r->size;
    const float d2 = fmax(dot(to, to), LEAST), d = sqrt(d2), height = dot(r->normal, to);
    *open = false;
    if (height < -extent || dot(r->horizon, to) < -extent)
        return 0.0f;

    // Outside of the cone in which they shine, seen from anywhere on the texel?
    const float3 away = -to / d;
    const float sine = fmin(extent / d, 1.0f), cosine = sqrt(1.0f - sine * sine), widest = node->cos_half_angle;
    const float rim = widest * cosine - sqrt(fmax(1.0f - widest * widest, 0.0f)) * sine;
    if (extent < d && widest > -cosine && dot(vload3(0, node->axis), away) < rim - 1e-5f)
        return 0.0f;
    *open = radius > OPENING * d;

    // The floors stand for what the centre does not see, but a part of the node may.
    const float3 squares = away * away;
    const float3 products = (float3)(away.x * away.y, away.x * away.z, away.y * away.z);
    const float squared = dot(vload3(0, node->squares), squares) + 2.0f * dot(vload3(0, node->products), products);
    const float spread = sqrt(fmax(squared, 0.0f));
    const float directed = fmax(spread + dot(vload3(0, node->normal), away), 0.02f + 0.1f * fmin(radius / d, 1.0f));
    return (node->alike + node->directed * directed) * fmax(height / d, 0.05f + 0.1f * fmin(radius / d, 1.0f))
        / fmax(d2, SPREAD * SPREAD * r->size * r->size);
}

// The weight of an inner node or an emitter.
__attribute__((noinline))
float weight_of(const Lights *lights, const int code, const Receiver *r, bool *open)
{
    *open = false;
    return code < 0 ? emitter_weight(lights->emitters + ~code, r, &lights->modulations, lights->sky_total)
        : node_weight(lights->nodes + code, r, open);
}

// Weights that are kept from one way down the tree to the next, which comes to the same nodes in the same order: -1 of
// a node that is not taken as one light.
#define WEIGHTS_KEPT 32

// The weight of all lights: of emitters nearby, and of nodes far away. The first ones are kept.
float total_weight(const Lights *lights, const int root, const Receiver *r, float *kept)
{
    int stack[TREE_STACK], depth = 0, code = root;
    float total = 0.0f;
    for (int visit = 0;; ++visit) {
        bool open;
        const float weight = weight_of(lights, code, r, &open);
        if (visit < WEIGHTS_KEPT)
            kept[visit] = open ? -1.0f : weight;
        if (open) {
            const int2 halves = vload2(0, lights->nodes[code].children);
            stack[depth++] = halves.y;
            code = halves.x;
            continue;
        }
        total += weight;
        if (depth == 0)
            return total;
        code = stack[--depth];
    }
}

// Samples on their way: they lie evenly on a line, on which every emitter has an interval. Nodes wait
// for their turn with the end and the width of theirs; a negative width is not known yet.
typedef struct {
    int codes[TREE_STACK];
    float2 spans[TREE_STACK];
    int depth;
    float scale;   // width of a weight of 1
    float passed;  // where the intervals of nodes taken as one light end so far
    int visits;    // of how many nodes and emitters the weight was asked for
    float kept[WEIGHTS_KEPT];
    int own;       // how many more emitters may have a sample of their own
} Walk;

// At the root, with all `budget` samples before it; return what all lights weigh.
float start_walk(Walk *walk, const Lights *lights, const int root, const Receiver *r, const int budget)
{
    const float total = total_weight(lights, root, r, walk->kept);
    walk->codes[0] = root;
    walk->spans[0] = (float2)(0.0f, -1.0f);
    walk->depth = 1;
    walk->scale = budget / total;
    walk->passed = 0.0f;
    walk->visits = 0;
    walk->own = (int)(PART_OF_OWN * budget);
    return total;
}

// The weight of a node or an emitter that `total_weight` came to, too.
float weight_again(Walk *walk, const Lights *lights, const int code, const Receiver *r, bool *open)
{
    const int visit = walk->visits++;
    if (visit >= WEIGHTS_KEPT)
        return weight_of(lights, code, r, open);
    *open = walk->kept[visit] < 0.0f;
    return walk->kept[visit];
}

// The emitter whose interval a sample lies in, with the interval's end and width; -1 if nothing there shines. Before
// it come those that have a sample of their own: their width is 1, whether or not the sample lies in their interval.
int next_emitter(Walk *walk, const Lights *lights, const Receiver *r, const float sample, float2 *span)
{
    while (walk->depth > 0) {
        const int code = walk->codes[--walk->depth];
        *span = walk->spans[walk->depth];
        bool open = false;
        if (span->y < 0.0f) {
            const float weight = weight_again(walk, lights, code, r, &open);
            if (!open) {
                walk->passed += weight * walk->scale;
                *span = (float2)(walk->passed, weight * walk->scale);
                if (code < 0 && lights->emitters[~code].uniform && span->y >= OWN_SAMPLE && span->y < 1.0f
                    && walk->own > 0) {
                    --walk->own;
                    span->y = 1.0f;
                    return ~code;
                }
            }
        }
        if (!open && (sample >= span->x || span->y <= 0.0f))
            continue;
        if (code < 0)
            return ~code;
        const int2 halves = vload2(0, lights->nodes[code].children);
        float2 first = *span, second = *span;
        if (!open) {
            // Below, an interval is split in proportion to what the halves may bring.
            bool ignored;
            const float a = weight_of(lights, halves.x, r, &ignored);
            const float b = weight_of(lights, halves.y, r, &ignored);
            if (!(a + b > 0.0f))
                return -1;
            second.y = span->y * (b / (a + b));
            first = (float2)(span->x - second.y, span->y * (a / (a + b)));
        }
        walk->codes[walk->depth] = halves.y;
        walk->spans[walk->depth++] = second;
        walk->codes[walk->depth] = halves.x;
        walk->spans[walk->depth++] = first;
    }
    span->x = INFINITY;
    return -1;
}
