#pragma once
#include "receiver.cl"
#include "modulation.cl"
#include "emitters.cl"

// Light tree: importance sampling of many emitters (engine/direct/light_tree.py builds the tree). Distant nodes are
// treated as one light; samples descend in proportion to estimated irradiance.

#define TREE_STACK 32  // the tree is balanced: enough for 2^31 emitters

// Opening criterion of Barnes and Hut 1986: a node counts as one light if its radius is below this fraction of its
// distance.
#define OPENING 0.4f

// A near uniform emitter with an expected sample count between OWN_SAMPLE and 1 gets exactly one sample instead of a
// random one. Its irradiance is analytic except for the shadow, and a random sample would turn it into noise. These
// samples are limited to a fraction PART_OF_OWN of the patch's budget.
#define OWN_SAMPLE 0.1f
#define PART_OF_OWN 0.25f

typedef struct {
    __global const Emitter *emitters;
    __global const LightNode *nodes;
    float sky_total;
    Modulations modulations;
} Lights;

// Estimates the unshadowed irradiance from all emitters of an inner node. Returns 0 only if none of them can
// contribute. open: set if the node is too near to be one light.
float node_weight(__global const LightNode *node, const Receiver *r, bool *open)
{
    const float3 to = vload3(0, node->centre) - r->at;
    const float radius = node->radius, extent = radius + r->size;
    const float d2 = fmax(dot(to, to), LEAST), d = sqrt(d2), height = dot(r->normal, to);
    *open = false;
#ifndef SPHERE
    if (height < -extent || dot(r->horizon, to) < -extent)
        return 0.0f;
#endif

    // Cull the node if the texel lies outside the cone of its emission.
    const float3 away = -to / d;
    const float sine = fmin(extent / d, 1.0f), cosine = sqrt(1.0f - sine * sine), widest = node->cos_half_angle;
    const float rim = widest * cosine - sqrt(fmax(1.0f - widest * widest, 0.0f)) * sine;
    if (extent < d && widest > -cosine && dot(vload3(0, node->axis), away) < rim - 1e-5f)
        return 0.0f;
    *open = radius > OPENING * d;

    // Use lower bounds where the estimate at the node's centre misses parts of the node.
    const float3 squares = away * away;
    const float3 products = (float3)(away.x * away.y, away.x * away.z, away.y * away.z);
    const float squared = dot(vload3(0, node->squares), squares) + 2.0f * dot(vload3(0, node->products), products);
    const float spread = sqrt(fmax(squared, 0.0f));
    const float directed = fmax(spread + dot(vload3(0, node->normal), away), 0.02f + 0.1f * fmin(radius / d, 1.0f));
    return (node->alike + node->directed * directed) * COSINE(height / d, 0.05f + 0.1f * fmin(radius / d, 1.0f))
        / fmax(d2, SPREAD * SPREAD * r->size * r->size);
}

// Estimates the irradiance from an inner node (code >= 0) or an emitter (~code).
__attribute__((noinline)) float weight_of(const Lights *lights, const int code, const Receiver *r, bool *open)
{
    *open = false;
    return code < 0 ? emitter_weight(lights->emitters + ~code, r, &lights->modulations, lights->sky_total)
                    : node_weight(lights->nodes + code, r, open);
}

// Number of weights cached by the first traversal for the second, which visits the same nodes in the same order. A
// cached -1 marks a node to be opened.
#define WEIGHTS_KEPT 32

// Sums the weights of all lights: near emitters and distant nodes. Caches the first WEIGHTS_KEPT.
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

// State of the descent through the light tree. Samples lie at integer steps on a line, on which each emitter owns an
// interval. The stack holds nodes with the end and width of their intervals; a negative width is not computed yet.
typedef struct {
    int codes[TREE_STACK];
    float2 spans[TREE_STACK];
    int depth;
    float scale;   // interval width per unit of weight
    float passed;  // end of the last interval so far
    int visits;    // weights requested so far
    float kept[WEIGHTS_KEPT];
    int own;  // remaining emitters with a sample of their own
} Walk;

// Starts the descent at the root with a budget of samples. Returns the total weight.
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

// Returns the weight of a node visited in total_weight, from the cache if possible.
float weight_again(Walk *walk, const Lights *lights, const int code, const Receiver *r, bool *open)
{
    const int visit = walk->visits++;
    if (visit >= WEIGHTS_KEPT)
        return weight_of(lights, code, r, open);
    *open = walk->kept[visit] < 0.0f;
    return walk->kept[visit];
}

// Returns the emitter whose interval contains a sample, with end and width of the interval; -1 if none. Emitters with a
// sample of their own are returned before it, with width 1.
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
            // The two children divide their parent's interval in proportion to their estimated irradiance.
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
