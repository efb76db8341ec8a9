#pragma once
#include "emitters.glsl"
#include "resumed.glsl"

// A tree over emitters (engine/direct/light_tree.py), and the way of a patch's samples down to emitters.
// As kernels/direct/light_tree.cl.

layout(std430, binding = 5) readonly buffer LightNodes { LightNode light_nodes[]; };

#define TREE_STACK 32  // the tree is balanced: enough for 2^31 emitters

// A node is taken as one light if its radius is less than this part of the distance (Barnes and Hut 1986).
#define OPENING 0.4

// An emitter nearby, of one radiance, that expects at least this many samples but less than one has one of its own, not
// by lot. These are at most a part of a patch's samples.
#define OWN_SAMPLE 0.1
#define PART_OF_OWN 0.25

// About how much light all emitters of an inner node bring without shadow; 0 only if they bring none.
// `open` is set if the node is too near to be taken as one light.
float node_weight(const int node, const Receiver r, out bool open)
{
    vec3 to = TO_VEC3(light_nodes[node].centre) - r.at;
    float radius = light_nodes[node].radius, extent = radius + r.size;
    float d2 = max(dot(to, to), LEAST), d = sqrt(d2), height = dot(r.normal, to);
    open = false;
    if (height < -extent || dot(r.horizon, to) < -extent)
        return 0.0;

    // Outside of the cone in which they shine, seen from anywhere on the texel?
    vec3 away = -to / d;
    float sine = min(extent / d, 1.0), cosine = sqrt(1.0 - sine * sine), widest = light_nodes[node].cos_half_angle;
    float rim = widest * cosine - sqrt(max(1.0 - widest * widest, 0.0)) * sine;
    if (extent < d && widest > -cosine && dot(TO_VEC3(light_nodes[node].axis), away) < rim - 1e-5)
        return 0.0;
    open = radius > OPENING * d;

    // The floors stand for what the centre does not see, but a part of the node may.
    vec3 squares = away * away, products = vec3(away.x * away.y, away.x * away.z, away.y * away.z);
    float squared = dot(TO_VEC3(light_nodes[node].squares), squares)
        + 2.0 * dot(TO_VEC3(light_nodes[node].products), products);
    float spread = sqrt(max(squared, 0.0));
    float directed = max(spread + dot(TO_VEC3(light_nodes[node].normal), away), 0.02 + 0.1 * min(radius / d, 1.0));
    return (light_nodes[node].alike + light_nodes[node].directed * directed)
        * max(height / d, 0.05 + 0.1 * min(radius / d, 1.0)) / max(d2, SPREAD * SPREAD * r.size * r.size);
}

// The weight of an inner node or an emitter.
float weight_of(const int code, const Receiver r, out bool open)
{
    open = false;
    if (code < 0)
        return emitter_weight(~code, r);
    return node_weight(code, r, open);
}

// Weights that are kept from one way down the tree to the next, which comes to the same nodes in the same order: -1 of
// a node that is not taken as one light.
#define WEIGHTS_KEPT 32

// Samples on their way: they lie evenly on a line, on which every emitter has an interval. Nodes wait
// for their turn with the end and the width of theirs; a negative width is not known yet.
// Codes, ends and widths are in the item's state, from word `walk_first` on, followed by the weights that are kept.
int walk_first;
int walk_depth;
bool walk_counts;   // on the first way down, which sums weights
float walk_total;   // the weight of all lights: of emitters nearby, and of nodes far away
float walk_scale;   // width of a weight of 1
float walk_passed;  // where the intervals of nodes taken as one light end so far
int walk_visits;    // nodes and emitters whose weight was asked for
int walk_own;       // further emitters that may have a sample of their own

void put_on_walk(const int code, const vec2 span)
{
    int at = walk_first + 3 * walk_depth++;
    states[at] = uint(code);
    states[at + 1] = floatBitsToUint(span.x);
    states[at + 2] = floatBitsToUint(span.y);
}

// To the root, before a way down.
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

// The emitter whose interval a sample lies in, with the interval's end and width; -1 if nothing there shines. Before
// it come those that have a sample of their own: their width is 1, whether or not the sample lies in their interval.
// The first call finds the total weight; functions `total_weight`, `weight_again` and this one of
// kernels/direct/light_tree.cl are one here, so that weights are computed in one place: drivers inline every call.
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

        // The weight of a new one, else those of both halves: their intervals are in proportion to what they may bring.
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
