#include "texel.cl"

// Fills texels without light: dilation in rings around charts (engine/postprocess/dilation.py), and a membrane that
// interpolates from coarse to fine (engine/postprocess/membrane_fill.py).

#define EMPTY 0
#define UNKNOWN 1
#define KNOWN 2

#define FAR 65535  // no known texel within reach

// Index of the lightmap. Images are stored one output after another, each for all lightmaps; outputs share the states
// of texels.
#define ATLAS (get_global_id(2) % atlases)
#define IN_ATLAS(x, y) ((ATLAS * height + (y)) * width + (x))

// Stores the distance to the nearest known texel in the same row; FAR if beyond `reach`.
__kernel void distance_in_row(__global const uchar *known, __global ushort *distance, const int reach, const int width,
                              const int height)
{
    TEXEL;
    int nearest = known[texel] ? 0 : FAR;
    for (int step = 1; step <= reach && nearest == FAR; ++step)
        if ((x >= step && known[texel - step]) || (x + step < width && known[texel + step]))
            nearest = step;
    distance[texel] = nearest;
}

// Stores the Chebyshev distance to the nearest known texel, from the distances within rows.
__kernel void distance_in_column(__global const ushort *in_row, __global ushort *distance, const int reach,
                                 const int width, const int height)
{
    TEXEL;
    int nearest = in_row[texel];
    for (int step = 1; step <= reach && step < nearest; ++step) {
        if (y >= step)
            nearest = min(nearest, max(step, (int)in_row[AT(x, y - step)]));
        if (y + step < height)
            nearest = min(nearest, max(step, (int)in_row[AT(x, y + step)]));
    }
    distance[texel] = nearest <= reach ? nearest : FAR;
}

// Adds texels, by flat index, to a mask.
__kernel void mark_texels(__global const uint *texels, __global uchar *mask, const int count)
{
    const int i = get_global_id(0);
    if (i < count)
        mask[texels[i]] = 1;
}

// Fills one ring of texels with the mean of their neighbours on a chart's surface, or else in inner rings.
__kernel void dilate_ring(__global const ushort *distance, __global const uchar *surface, const int ring,
                          __global float4 *image, const uint atlases, const int width, const int height)
{
    TEXEL;
    if (distance[IN_ATLAS(x, y)] != ring)
        return;
    float4 sum = (float4)(0.0f), surface_sum = (float4)(0.0f);
    float total = 0.0f, surface_total = 0.0f;
    for (int v = max(y - 1, 0); v <= min(y + 1, height - 1); ++v)
        for (int u = max(x - 1, 0); u <= min(x + 1, width - 1); ++u) {
            if (distance[IN_ATLAS(u, v)] >= ring)
                continue;
            sum += image[AT(u, v)];
            total += 1.0f;
            if (surface[IN_ATLAS(u, v)]) {
                surface_sum += image[AT(u, v)];
                surface_total += 1.0f;
            }
        }
    image[texel] = surface_total > 0.0f ? surface_sum / surface_total : sum / total;
}

// Classifies texels for the membrane: known up to `rings`; unknown beyond and where texels lie inside geometry; else
// empty.
__kernel void classify(__global const ushort *distance, __global const uchar *inside, const int rings,
                       __global uchar *states, const int width, const int height)
{
    TEXEL;
    states[texel] = distance[texel] <= rings ? KNOWN : inside[texel] || distance[texel] < FAR ? UNKNOWN : EMPTY;
}

// Returns true if a 2 x 2 block holds a known texel.
bool has_known(__global const uchar *fine, const int fine_width, const int fine_height, const int x, const int y)
{
    bool known = false;
    for (int v = 2 * y; v < min(2 * y + 2, fine_height); ++v)
        for (int u = 2 * x; u < min(2 * x + 2, fine_width); ++u)
            known |= fine[v * fine_width + u] == KNOWN;
    return known;
}

// Returns the mean of the known texels in a 2 x 2 block, or 0.
float4 mean_of_known(__global const uchar *states, __global const float4 *fine, const int fine_width,
                     const int fine_height, const int x, const int y)
{
    float4 sum = (float4)(0.0f);
    float total = 0.0f;
    for (int v = 2 * y; v < min(2 * y + 2, fine_height); ++v)
        for (int u = 2 * x; u < min(2 * x + 2, fine_width); ++u) {
            if (states[v * fine_width + u] == KNOWN) {
                sum += fine[v * fine_width + u];
                total += 1.0f;
            }
        }
    return total > 0.0f ? sum / total : (float4)(0.0f);
}

// Returns the bilinear interpolation of a coarser image: weight 3/4 for the nearer block along each axis.
float4 interpolated(__global const float4 *coarse, const int coarse_width, const int coarse_height, const int x,
                    const int y)
{
    const int2 near = (int2)(x / 2, y / 2);
    const int2 far =
        clamp(near + (int2)(x % 2 ? 1 : -1, y % 2 ? 1 : -1), (int2)(0), (int2)(coarse_width - 1, coarse_height - 1));
    __global const float4 *near_row = coarse + (size_t)near.y * coarse_width;
    __global const float4 *far_row = coarse + (size_t)far.y * coarse_width;
    return (9.0f * near_row[near.x] + 3.0f * near_row[far.x] + 3.0f * far_row[near.x] + far_row[far.x]) / 16.0f;
}

// Returns the mean of the four neighbours of an unknown texel; an empty neighbour is replaced by the texel itself.
float4 mean_of_neighbours(__global const uchar *states, __global const float4 *image, __global const float4 *before,
                          const int width, const int height, const int x, const int y)
{
    const int2 steps[4] = {(int2)(0, -1), (int2)(0, 1), (int2)(-1, 0), (int2)(1, 0)};
    float4 sum = (float4)(0.0f);
    for (int i = 0; i < 4; ++i) {
        const int u = x + steps[i].x, v = y + steps[i].y;
        const bool inside = u >= 0 && u < width && v >= 0 && v < height;
        const uchar state = inside ? states[v * width + u] : EMPTY;
        const size_t other = state == EMPTY ? (size_t)y * width + x : (size_t)v * width + u;
        sum += state == KNOWN ? image[other] : before[other];
    }
    return sum / 4.0f;
}

// Computes the states of a coarser scale: a 2 x 2 block is known if it holds a known texel.
__kernel void coarser_states(__global const uchar *fine, const int fine_width, const int fine_height,
                             __global uchar *states, const int width, const int height)
{
    TEXEL;
    fine += get_global_id(2) * fine_height * fine_width;
    states[texel] = has_known(fine, fine_width, fine_height, x, y) ? KNOWN : UNKNOWN;
}

// Restricts an image to a coarser scale by the mean of the known texels of each block.
__kernel void restrict_mean(__global const uchar *states, __global const float4 *fine, const int fine_width,
                            const int fine_height, __global float4 *image, const uint atlases, const int width,
                            const int height)
{
    TEXEL;
    const size_t size = (size_t)fine_height * fine_width;
    image[texel] = mean_of_known(states + ATLAS * size, fine + get_global_id(2) * size, fine_width, fine_height, x, y);
}

// Initialises unknown texels from the coarser scale; empty texels become 0.
__kernel void prolongate(__global const uchar *states, __global const float4 *coarse, const int coarse_width,
                         const int coarse_height, __global float4 *image, const uint atlases, const int width,
                         const int height)
{
    TEXEL;
    const uchar state = states[IN_ATLAS(x, y)];
    if (state == KNOWN)
        return;
    coarse += get_global_id(2) * coarse_height * coarse_width;
    image[texel] = state == EMPTY ? (float4)(0.0f) : interpolated(coarse, coarse_width, coarse_height, x, y);
}

// Relaxes the membrane by one Jacobi iteration: each unknown texel becomes the mean of its neighbours.
__kernel void relax(__global const uchar *states, __global const float4 *image, __global const float4 *before,
                    __global float4 *after, const uint atlases, const int width, const int height)
{
    TEXEL;
    if (states[IN_ATLAS(x, y)] != UNKNOWN)
        return;
    const size_t size = (size_t)height * width, plane = get_global_id(2) * size;
    after[texel] = mean_of_neighbours(states + ATLAS * size, image + plane, before + plane, width, height, x, y);
}

// Returns the side of an image at a scale; each scale has half the side of the finer one, rounded up.
int side_of(const int side, const int scale) { return (side + (1 << scale) - 1) >> scale; }

// Runs coarser_states, restrict_mean, prolongate and relax at all scales of small images, one work group per image.
// states, images: all coarser scales, `texels` per image. relaxed: buffer as large as the finest images.
__kernel void fill_small(__global const uchar *finest_states, __global float4 *finest, __global uchar *states,
                         __global float4 *images, __global float4 *relaxed, const int relaxations, const int texels,
                         const uint atlases, const int width, const int height)
{
    const size_t size = (size_t)width * height, image = get_group_id(0);
    const int item = get_local_id(0), items = get_local_size(0);
    finest_states += image % atlases * size;
    finest += image * size;
    states += image * texels;
    images += image * texels;
    relaxed += image * size;

    // Restrict to coarser scales.
    __global const uchar *fine_states = finest_states;
    __global const float4 *fine = finest;
    int scales = 0, first = 0;
    while (max(side_of(width, scales), side_of(height, scales)) > 1) {
        const int fine_width = side_of(width, scales), fine_height = side_of(height, scales);
        ++scales;
        const int w = side_of(width, scales), count = w * side_of(height, scales);
        for (int i = item; i < count; i += items) {
            const int x = i % w, y = i / w;
            states[first + i] = has_known(fine_states, fine_width, fine_height, x, y) ? KNOWN : UNKNOWN;
            images[first + i] = mean_of_known(fine_states, fine, fine_width, fine_height, x, y);
        }
        barrier(CLK_GLOBAL_MEM_FENCE);
        fine_states = states + first;
        fine = images + first;
        first += count;
    }

    // Prolongate and relax back to the finest scale.
    for (int scale = scales - 1; scale >= 0; --scale) {
        const int w = side_of(width, scale), h = side_of(height, scale), count = w * h;
        const int coarse_width = side_of(width, scale + 1), coarse_height = side_of(height, scale + 1);
        first -= coarse_width * coarse_height;
        __global const float4 *coarse = images + first;
        __global const uchar *here = scale ? states + first - count : finest_states;
        __global float4 *filled = scale ? images + first - count : finest;
        for (int i = item; i < count; i += items)
            if (here[i] != KNOWN)
                filled[i] =
                    here[i] == EMPTY ? (float4)(0.0f) : interpolated(coarse, coarse_width, coarse_height, i % w, i / w);
        for (int round = 0; round < relaxations; ++round) {
            __global const float4 *before = round % 2 ? relaxed : filled;
            __global float4 *after = round % 2 ? filled : relaxed;
            barrier(CLK_GLOBAL_MEM_FENCE);
            for (int i = item; i < count; i += items)
                if (here[i] == UNKNOWN)
                    after[i] = mean_of_neighbours(here, filled, before, w, h, i % w, i / w);
        }
        barrier(CLK_GLOBAL_MEM_FENCE);
    }
}
