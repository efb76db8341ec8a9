#pragma once
#include "emitters.glsl"
#include "resumed.glsl"

// Light tree: importance sampling of many emitters (engine/direct/light_tree.py builds the tree). The same algorithm as
// kernels/direct/light_tree.cl.

layout(std430, binding = 5) readonly buffer LightNodes { LightNode light_nodes[]; };

#define TREE_STACK 32  // the tree is balanced: enough for 2^31 emitters

// Opening criterion of Barnes and Hut 1986: a node counts as one light if its radius is below this fraction of its
// distance.
#define OPENING 0.4

// A near uniform emitter with an expected sample count between OWN_SAMPLE and 1 gets exactly one sample instead of a
// random one. These samples are limited to a fraction PART_OF_OWN of the patch's budget.
#define OWN_SAMPLE 0.1
#define PART_OF_OWN 0.25

// Estimates the unshadowed irradiance from all emitters of an inner node. Returns 0 only if none of them can
// contribute. open: set if the node is too near to be one light.
float node_weight(const int node, const Receiver r, out bool open)
{
    vec3 to = TO_VEC3(light_nodes[node].centre) - r.at;
    float radius = light_nodes[node].radius, extent = radius + r.size;
    float d2 = max(dot(to, to), LEAST), d = sqrt(d2), height = dot(r.normal, to);
    open = false;
    if (height < -extent || dot(r.horizon, to) < -extent)
        return 0.0;

    // Cull the node if the texel lies outside the cone of its emission.
    vec3 away = -to / d;
    float sine = min(extent / d, 1.0), cosine = sqrt(1.0 - sine * sine), widest = light_nodes[node].cos_half_angle;
    float rim = widest * cosine - sqrt(max(1.0 - widest * widest, 0.0)) * sine;
    if (extent < d && widest > -cosine && dot(TO_VEC3(light_nodes[node].axis), away) < rim - 1e-5)
        return 0.0;
    open = radius > OPENING * d;

    // Use lower bounds where the estimate at the node's centre misses parts of the node.
    vec3 squares = away * away, products = vec3(away.x * away.y, away.x * away.z, away.y * away.z);
    float squared = dot(TO_VEC3(light_nodes[node].squares), squares)
        + 2.0 * dot(TO_VEC3(light_nodes[node].products), products);
    float spread = sqrt(max(squared, 0.0));
    float directed = max(spread + dot(TO_VEC3(light_nodes[node].normal), away), 0.02 + 0.1 * min(radius / d, 1.0));
    return (light_nodes[node].alike + light_nodes[node].directed * directed)
        * max(height / d, 0.05 + 0.1 * min(radius / d, 1.0)) / max(d2, SPREAD * SPREAD * r.size * r.size);
}

// Estimates the irradiance from an inner node (code >= 0) or an emitter (~code).
float weight_of(const int code, const Receiver r, out bool open)
{
    open = false;
    if (code < 0)
        return emitter_weight(~code, r);
    return node_weight(code, r, open);
}

// Number of weights cached by the first traversal for the next ones, which visit the same nodes in the same order. A
// cached -1 marks a node to be opened.
#define WEIGHTS_KEPT 32

// Descent through the light tree. Samples lie at integer steps on a line, on which each emitter owns an interval. The
// stack holds nodes with the end and width of their intervals; a negative width is not computed yet. Codes, ends and
// widths are in the item's state from word `walk_first` on, followed by the cached weights.
int walk_first;
int walk_depth;
bool walk_counts;   // true in the first descent, which sums the weights
float walk_total;   // total weight of near emitters and far nodes
float walk_scale;   // interval width per unit of weight
float walk_passed;  // end of the last interval of a node that counts as one light
int walk_visits;    // number of weights used, for the cache
int walk_own;       // number of emitters that may still get a sample of their own

void put_on_walk(const int code, const vec2 span)
{
    int at = walk_first + 3 * walk_depth++;
    states[at] = uint(code);
    states[at + 1] = floatBitsToUint(span.x);
    states[at + 2] = floatBitsToUint(span.y);
}

// Returns to the root before a descent.
void begin_walk(const int root, const bool counts)
{
    walk_depth = 0;
    walk_counts = counts;
    walk_visits = 0;
    walk_passed = 0.0;
    put_on_walk(root, vec2(0.0, -1.0));
}

void start_walk(const int root, const int budget)
{
    begin_walk(root, true);
    walk_total = 0.0;
    walk_own = int(PART_OF_OWN * float(budget));
}

// Returns the emitter whose interval contains a sample, with end and width of the interval; -1 if none. Emitters with a
// sample of their own are returned before it, with width 1. The first call computes the total weight. This function
// combines `total_weight`, `weight_again` and `next_emitter` of kernels/direct/light_tree.cl, so that weights are
// computed at one place of the code: drivers inline every call.
int next_emitter(const Receiver r, const int root, const int budget, const float sample_, out vec2 span)
{
    for (;;) {
        ++steps;
        span = vec2(INFINITY, 0.0);
        if (walk_depth == 0) {
            if (!walk_counts || !(walk_total > 0.0))
                return -1;
            begin_walk(root, false);
            walk_scale = float(budget) / walk_total;
        }
        int at = walk_first + 3 * --walk_depth;
        int code = int(states[at]);
        span = vec2(uintBitsToFloat(states[at + 1]), uintBitsToFloat(states[at + 2]));
        bool is_new = span.y < 0.0;
        if (!is_new) {
            if (sample_ >= span.x || span.y <= 0.0)
                continue;
            if (code < 0)
                return ~code;
        }

        // Compute the weight of a new node. Two children divide their parent's interval in proportion to their
        // estimated irradiance.
        bool open = false, is_kept = false;
        vec2 weights = vec2(0.0);
        int visit = walk_visits;
        if (is_new) {
            ++walk_visits;
            if (!walk_counts && visit < WEIGHTS_KEPT) {
                is_kept = true;
                weights.x = uintBitsToFloat(states[walk_first + 3 * TREE_STACK + visit]);
                open = weights.x < 0.0;
            }
        }
        for (int i = 0; i < (is_kept ? 0 : is_new ? 1 : 2); ++i) {
            float weight = weight_of(is_new ? code : light_nodes[code].children[i], r, open);
            if (i == 0)
                weights.x = weight;
            else
                weights.y = weight;
        }
        if (!is_new) {
            float both = weights.x + weights.y;
            if (!(both > 0.0))
                return -1;
            float width = span.y * (weights.y / both);
            put_on_walk(light_nodes[code].children[1], vec2(span.x, width));
            put_on_walk(light_nodes[code].children[0], vec2(span.x - width, span.y * (weights.x / both)));
            continue;
        }
        if (walk_counts && visit < WEIGHTS_KEPT)
            states[walk_first + 3 * TREE_STACK + visit] = floatBitsToUint(open ? -1.0 : weights.x);
        if (open) {
            put_on_walk(light_nodes[code].children[1], vec2(0.0, -1.0));
            put_on_walk(light_nodes[code].children[0], vec2(0.0, -1.0));
        } else if (walk_counts) {
            walk_total += weights.x;
        } else {
            walk_passed += weights.x * walk_scale;
            span = vec2(walk_passed, weights.x * walk_scale);
            if (code < 0 && emitters[~code].uniform_ != 0 && span.y >= OWN_SAMPLE && span.y < 1.0 && walk_own > 0) {
                --walk_own;
                span.y = 1.0;
                return ~code;
            }
            put_on_walk(code, span);
        }
    }
}
