#include "texel.cl"

// Fills unknown texels of images: rings that grow from charts (engine/finish/dilation.py), and a membrane over known
// texels from coarse to fine (engine/finish/smooth_fill.py).

#define EMPTY 0
#define UNKNOWN 1
#define KNOWN 2

#define FAR 65535  // no known texel within reach

// What is filled are images of several outputs, one after the other, each of all atlases: they share what is known of
// the texels of an atlas.
#define ATLAS (get_global_id(2) % atlases)
#define IN_ATLAS(x, y) ((ATLAS * height + (y)) * width + (x))

// Texels along the row to the nearest known one.
__kernel void distance_in_row(__global const uchar *known, __global ushort *distance, const int reach,
                              const int width, const int height)
{
    TEXEL;
    int nearest = known[texel] ? 0 : FAR;
    for (int step = 1; step <= reach && nearest == FAR; ++step)
        if ((x >= step && known[texel - step]) || (x + step < width && known[texel + step]))
            nearest = step;
    distance[texel] = nearest;
}

// Rings around known texels up to each one (Chebyshev distance), of what is known of rows.
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

// A ring of texels, each with the mean of its neighbours on a chart's surface, else in inner rings.
__kernel void grow(__global const ushort *distance, __global const uchar *surface, const int ring,
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

// What texels are to the membrane: known up to some rings, unknown in further ones and where nobody sees them.
__kernel void classify(__global const ushort *distance, __global const uchar *inside, const int rings,
                       __global uchar *states, const int width, const int height)
{
    TEXEL;
    states[texel] = distance[texel] <= rings ? KNOWN : inside[texel] || distance[texel] < FAR ? UNKNOWN : EMPTY;
}

// Squares of two by two texels: those that hold a known one are known.
__kernel void coarser_states(__global const uchar *fine, const int fine_width, const int fine_height,
                             __global uchar *states, const int width, const int height)
{
    TEXEL;
    bool known = false;
    for (int v = 2 * y; v < min(2 * y + 2, fine_height); ++v)
        for (int u = 2 * x; u < min(2 * x + 2, fine_width); ++u)
            known |= fine[((size_t)get_global_id(2) * fine_height + v) * fine_width + u] == KNOWN;
    states[texel] = known ? KNOWN : UNKNOWN;
}

// The mean of the known texels in each square.
__kernel void coarser(__global const uchar *states, __global const float4 *fine, const int fine_width,
                      const int fine_height, __global float4 *image, const uint atlases, const int width,
                      const int height)
{
    TEXEL;
    float4 sum = (float4)(0.0f);
    float total = 0.0f;
    for (int v = 2 * y; v < min(2 * y + 2, fine_height); ++v)
        for (int u = 2 * x; u < min(2 * x + 2, fine_width); ++u) {
            if (states[(ATLAS * fine_height + v) * fine_width + u] == KNOWN) {
                sum += fine[((size_t)get_global_id(2) * fine_height + v) * fine_width + u];
                total += 1.0f;
            }
        }
    image[texel] = total > 0.0f ? sum / total : (float4)(0.0f);
}

// Unknown texels from the coarser image, interpolated: the nearer square of each axis has 3/4. Empty ones are 0.
__kernel void finer(__global const uchar *states, __global const float4 *coarse, const int coarse_width,
                    const int coarse_height, __global float4 *image, const uint atlases, const int width,
                    const int height)
{
    TEXEL;
    const uchar state = states[IN_ATLAS(x, y)];
    if (state == KNOWN)
        return;
    if (state == EMPTY) {
        image[texel] = (float4)(0.0f);
        return;
    }
    const int2 near = (int2)(x / 2, y / 2);
    const int2 far = clamp(near + (int2)(x % 2 ? 1 : -1, y % 2 ? 1 : -1), (int2)(0),
                           (int2)(coarse_width - 1, coarse_height - 1));
    __global const float4 *rows = coarse + (size_t)get_global_id(2) * coarse_height * coarse_width;
    __global const float4 *near_row = rows + (size_t)near.y * coarse_width, *far_row = rows + (size_t)far.y * coarse_width;
    image[texel] = (9.0f * near_row[near.x] + 3.0f * near_row[far.x] + 3.0f * far_row[near.x] + far_row[far.x]) / 16.0f;
}

// Every unknown texel becomes the mean of its four neighbours, itself where there is none; known ones stay in `image`.
__kernel void relax(__global const uchar *states, __global const float4 *image, __global const float4 *before,
                    __global float4 *after, const uint atlases, const int width, const int height)
{
    TEXEL;
    if (states[IN_ATLAS(x, y)] != UNKNOWN)
        return;
    const int2 steps[4] = {(int2)(0, -1), (int2)(0, 1), (int2)(-1, 0), (int2)(1, 0)};
    float4 sum = (float4)(0.0f);
    for (int i = 0; i < 4; ++i) {
        const int u = x + steps[i].x, v = y + steps[i].y;
        const bool inside = u >= 0 && u < width && v >= 0 && v < height;
        const uchar state = inside ? states[IN_ATLAS(u, v)] : EMPTY;
        const size_t other = state == EMPTY ? texel : AT(u, v);
        sum += state == KNOWN ? image[other] : before[other];
    }
    after[texel] = sum / 4.0f;
}
