#include "texel.cl"

// Detects texels whose irradiance or validity deviates from the mean of their neighbours; these texels are supersampled
// (engine/postprocess/irradiance_edges.py).

#define ON_EDGE 1
#define AT_AN_END 2
#define AT_A_BORDER 4

#define EDGE_OF_BACKS 0.1f  // minimum step of validity

// Returns the deviation of a value from the mean of two neighbours, relative to the largest of the three and at least
// `least`.
float off_mean(const float before, const float value, const float after, const float least)
{
    const float largest = fmax(fmax(before, after), fmax(value, least));
    return fabs(value - 0.5f * (before + after)) / fmax(largest, 1e-30f);
}

// Computes for each texel the deviation `off` of its irradiance from its neighbours, along rows and columns, and its
// marks. entries: patch + 1 of each texel, or 0; a neighbour without a patch counts as equal. marks: ON_EDGE at steps
// of validity, AT_A_BORDER without a neighbour on one side, AT_AN_END without both.
__kernel void find_edges(__global const uint *entries, __global const float *light, __global const float *front,
                         __global const uchar *hidden, const float least, __global float *off, __global uchar *marks,
                         const int width, const int height)
{
    TEXEL;
    const int own = (int)entries[texel] - 1;
    off[texel] = 0.0f;
    marks[texel] = own < 0 ? AT_AN_END : 0;
    if (own < 0)
        return;
    bool edge = false;
    for (int axis = 0; axis < 2; ++axis) {
        const int2 step = axis ? (int2)(0, 1) : (int2)(1, 0);
        const bool first = axis ? y == 0 : x == 0, last = axis ? y == height - 1 : x == width - 1;
        const int before = first ? -1 : (int)entries[AT(x - step.x, y - step.y)] - 1;
        const int after = last ? -1 : (int)entries[AT(x + step.x, y + step.y)] - 1;
        const int lower = before < 0 ? own : before, upper = after < 0 ? own : after;
        off[texel] = fmax(off[texel], off_mean(light[lower], light[own], light[upper], least));
        edge |= off_mean(front[lower], front[own], front[upper], 1.0f) > EDGE_OF_BACKS;
        if (before < 0 || after < 0)
            marks[texel] |= AT_A_BORDER;
        if (before < 0 && after < 0)
            marks[texel] |= AT_AN_END;
    }
    for (int v = max(y - 1, 0); v <= min(y + 1, height - 1); ++v)
        for (int u = max(x - 1, 0); u <= min(x + 1, width - 1); ++u) {
            const int other = (int)entries[AT(u, v)] - 1;
            edge |= other >= 0 && hidden[other] != hidden[own];
        }
    marks[texel] |= edge ? ON_EDGE : 0;
}

// Estimates the noise of each block of BLOCK x BLOCK texels: ABOVE_NOISE times the EVEN quantile of `off`, over the
// patches at every second texel of both axes. 0 for blocks without patches.
__kernel void noise_of_blocks(__global const uint *entries, __global const float *off, const int side,
                              __global float *noise, const int width, const int height)
{
    TEXEL;
    float values[BLOCK / 2 * (BLOCK / 2)];
    int count = 0;
    for (int v = y * BLOCK; v < min((y + 1) * BLOCK, side); v += 2)
        for (int u = x * BLOCK; u < min((x + 1) * BLOCK, side); u += 2) {
            const size_t place = ((size_t)get_global_id(2) * side + v) * side + u;
            if (entries[place])
                values[count++] = off[place];
        }

    // Select the noise quantile by rank: count the smaller values of each; equal values are ordered by position in the
    // list.
    const int rank = (int)(EVEN * count);
    noise[texel] = 0.0f;
    for (int i = 0; i < count; ++i) {
        int before = 0;
        for (int k = 0; k < count; ++k)
            before += values[k] < values[i] || (values[k] == values[i] && k < i);
        if (before == rank)
            noise[texel] = ABOVE_NOISE * values[i];
    }
}

// Marks texels whose deviation exceeds noise as ON_EDGE; at chart borders a neighbour's deviation suffices. blocks:
// number of blocks along each side of an image.
__kernel void mark_edges(__global const float *off, __global const float *noise, const int blocks,
                         __global uchar *marks, const int width, const int height)
{
    TEXEL;
    const float least = noise[((size_t)get_global_id(2) * blocks + y / BLOCK) * blocks + x / BLOCK];
    bool edge = off[texel] > fmax(EDGE, least);
    if (marks[texel] & AT_A_BORDER)
        for (int v = max(y - 1, 0); v <= min(y + 1, height - 1); ++v)
            for (int u = max(x - 1, 0); u <= min(x + 1, width - 1); ++u)
                edge |= off[AT(u, v)] > fmax(EDGE_NEAR_BORDER, least);
    marks[texel] |= edge ? ON_EDGE : 0;
}

// Writes the marks of texels, ON_EDGE also between two such texels of a row or column: a texel that is half in shadow
// has the mean of light and shadow, so it deviates from neither.
__kernel void join_edges(__global const uint *entries, __global const uchar *marks, __global uchar *joined,
                         const int width, const int height)
{
    TEXEL;
    bool edge = marks[texel] & ON_EDGE;
    if (entries[texel] && x > 0 && x < width - 1)
        edge |= marks[texel - 1] & marks[texel + 1] & ON_EDGE;
    if (entries[texel] && y > 0 && y < height - 1)
        edge |= marks[texel - width] & marks[texel + width] & ON_EDGE;
    joined[texel] = (edge ? ON_EDGE : 0) | (marks[texel] & AT_AN_END);
}
