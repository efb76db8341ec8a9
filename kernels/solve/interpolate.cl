#include "colour_sums.cl"

// Interpolates irradiance from patch groups to patches: local linear regression over the lightmap with distance weights
// (Cleveland 1979). A patch whose fit is poor is marked, and gathers by itself.

// Number of squares around a patch, its own included. Each contributes at most one group: the one on the patch's
// surface.
#define AROUND 9

// Minimum number of groups for a plane: with fewer, the residual does not measure the quality of the fit.
#define FEWEST 5

// A group lies on the patch's surface if two conditions hold. Its position is within OFF_PLANE squares of the
// extrapolated texel grid, and the cosine between the normals is at least SAME_WAY. If the validity of a group is below
// FRONTS, geometry stands on the surface there, and each patch has to gather by itself.
#define OFF_PLANE 0.5f
#define SAME_WAY 0.9f
#define FRONTS 0.9f

// Maximum difference of a patch's openness from the plane fitted to the groups. A larger difference indicates a groove
// between groups or a nearby object, where the irradiance differs too.
#define AS_OPEN 0.1f

// Distance in squares at which group weights reach 0; maximum sum of squared interpolation weights, which limits the
// gain of noise.
#define REACH 2.0f
#define MOST_GAIN 0.75f

typedef struct {
    float x, y, weight;  // in squares, along u and v
    int group;
    int square;  // in which of the squares around, row by row
} Anchor;

// Inverts a symmetric 3 x 3 matrix in the order xx, xy, xz, yy, yz, zz. Returns false if it is nearly singular.
bool invert(const float *m, float *inverse)
{
    inverse[0] = m[3] * m[5] - m[4] * m[4];
    inverse[1] = m[2] * m[4] - m[1] * m[5];
    inverse[2] = m[1] * m[4] - m[2] * m[3];
    inverse[3] = m[0] * m[5] - m[2] * m[2];
    inverse[4] = m[1] * m[2] - m[0] * m[4];
    inverse[5] = m[0] * m[3] - m[1] * m[1];
    const float determinant = m[0] * inverse[0] + m[1] * inverse[1] + m[2] * inverse[2];
    for (int k = 0; k < 6; ++k)
        inverse[k] /= determinant;
    return determinant > 1e-4f * m[0] * m[0] * m[0];
}

// Collects the groups around a patch that lie on its surface. Returns their number, or 0 if one of them is invalid.
int anchors_of(const int patch, __global const uint *texel_to_patch, const int resolution, const int width,
               __global const int *atlases, __global const int *texels, __global const int *groups,
               __global const int *leaders, __global const ReceiverRecord *receivers, __global const float4 *light,
               Anchor *anchors)
{
    const int texel = texels[patch], x = texel % resolution, y = texel / resolution;
    __global const uint *page = texel_to_patch + (size_t)atlases[patch] * resolution * resolution;
    __global const ReceiverRecord *own = receivers + patch;
    const float3 at = vload3(0, own->at), normal = vload3(0, own->normal);
    const float3 edge_u = vload3(0, own->edge_u), edge_v = vload3(0, own->edge_v);
    const float off = OFF_PLANE * width, farthest = off * off * fmax(dot(edge_u, edge_u), dot(edge_v, edge_v));
    int count = 0;
    for (int k = 0; k < AROUND; ++k) {
        const int tx = x + (k % 3 - 1) * width, ty = y + (k / 3 - 1) * width;
        if (tx < 0 || ty < 0 || tx >= resolution || ty >= resolution)
            continue;
        const uint entry = page[(size_t)ty * resolution + tx];
        if (entry == 0 || texels[entry - 1] != ty * resolution + tx)
            continue;
        const int group = groups[entry - 1], leader = leaders[group], there = texels[leader];
        const int dx = there % resolution - x, dy = there / resolution - y;
        __global const ReceiverRecord *other = receivers + leader;
        const float3 missed = vload3(0, other->at) - at - (float)dx * edge_u - (float)dy * edge_v;
        if (dot(missed, missed) > farthest || dot(vload3(0, other->normal), normal) < SAME_WAY)
            continue;
        if (light[group].w < FRONTS)
            return 0;
        Anchor *anchor = anchors + count;
        anchor->x = (float)dx / width;
        anchor->y = (float)dy / width;
        anchor->group = group;
        anchor->square = k;
        const float root = 1.0f - (anchor->x * anchor->x + anchor->y * anchor->y) / (REACH * REACH);
        anchor->weight = root * root;
        count += root > 0.0f;
    }
    return count;
}

// Computes the interpolation weight of each collected group at the patch. Inverts the moment matrix of their positions;
// returns false if the positions are collinear.
bool weigh(const Anchor *anchors, const int found, float *inverse, float *counts)
{
    float moments[6] = {0.0f};
    for (int k = 0; k < found; ++k) {
        const Anchor a = anchors[k];
        moments[0] += a.weight;
        moments[1] += a.weight * a.x;
        moments[2] += a.weight * a.y;
        moments[3] += a.weight * a.x * a.x;
        moments[4] += a.weight * a.x * a.y;
        moments[5] += a.weight * a.y * a.y;
    }
    if (!invert(moments, inverse))
        return false;
    for (int k = 0; k < found; ++k) {
        const Anchor a = anchors[k];
        counts[k] = a.weight * (inverse[0] + inverse[1] * a.x + inverse[2] * a.y);
    }
    return true;
}

// Interpolates `layers` of irradiance of groups to each patch; 0 where too few groups are near, and at least `lowest`.
// fits: 1 where the residual of the plane is at most `tolerance` times the local irradiance plus `beside` (patch
//     irradiance without the interpolated part), clamped to `least`..`most`. open: openness of patches
//     (near_openness.cl), or null.
__kernel void interpolate(__global const uint *texel_to_patch, const int resolution, const int width,
                          __global const int *atlases, __global const int *texels, __global const int *groups,
                          __global const int *leaders, __global const ReceiverRecord *receivers,
                          __global const float4 *light, const int layers, const int group_count,
                          __global const float *beside, __global const float *open, const float least, const float most,
                          const float tolerance, const float lowest, __global float4 *values, __global int *fits,
                          const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    fits[patch] = 0;
    for (int layer = 0; layer < layers; ++layer)
        values[(size_t)layer * count + patch] = (float4)(0.0f);
    Anchor anchors[AROUND];
    const int found = anchors_of(patch, texel_to_patch, resolution, width, atlases, texels, groups, leaders, receivers,
                                 light, anchors);
    if (found < FEWEST)
        return;
    float inverse[6], counts[AROUND];
    if (!weigh(anchors, found, inverse, counts))
        return;

    // Value and slope of the plane for the sum of channels.
    float gain = 0.0f, value = 0.0f, weights = 0.0f, nearer = open ? open[patch] : 0.0f;
    float2 slope = (float2)(0.0f);
    for (int k = 0; k < found; ++k) {
        const Anchor a = anchors[k];
        const float all = sum3(light[a.group]);
        weights += a.weight;
        gain += counts[k] * counts[k];
        value += counts[k] * all;
        nearer -= open ? counts[k] * open[leaders[a.group]] : 0.0f;
        slope += a.weight * all
            * (float2)(inverse[1] + inverse[3] * a.x + inverse[4] * a.y,
                       inverse[2] + inverse[4] * a.x + inverse[5] * a.y);
    }

    // At the end of a chart with only two rows or columns of squares, a plane would fit a step between them: use no
    // slope.
    int columns = 0, rows = 0;
    for (int k = 0; k < found; ++k) {
        columns |= 1 << anchors[k].square % 3;
        rows |= 1 << anchors[k].square / 3;
    }
    if (columns != 7 || rows != 7)
        slope = (float2)(0.0f);
    float left = 0.0f;
    for (int k = 0; k < found; ++k) {
        const Anchor a = anchors[k];
        const float off = sum3(light[a.group]) - value - slope.x * a.x - slope.y * a.y;
        left += a.weight * off * off;
    }
    left *= found / ((found - 3.0f) * weights);
    const float allowed = tolerance * clamp(value + beside[patch], least, most);
    fits[patch] = gain <= MOST_GAIN && left <= allowed * allowed && fabs(nearer) <= AS_OPEN;
    for (int layer = 0; layer < layers; ++layer) {
        float4 sum = (float4)(0.0f);
        for (int k = 0; k < found; ++k)
            sum += counts[k] * light[(size_t)layer * group_count + anchors[k].group];
        values[(size_t)layer * count + patch] = fmax(sum, lowest);
    }
}

// Interpolates `layers` of values of `group_count` groups to the chosen patches, or to all if null, with the same
// weights as `interpolate`. Stores 0 at patches whose `fits` is 0.
__kernel void spread(__global const uint *texel_to_patch, const int resolution, const int width,
                     __global const int *atlases, __global const int *texels, __global const int *groups,
                     __global const int *leaders, __global const ReceiverRecord *receivers,
                     __global const float4 *light, __global const int *fits, __global const int *chosen,
                     __global const float4 *values, const int layers, const int group_count,
                     __global float4 *spread_values, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const int patch = chosen ? chosen[i] : i;
    for (int layer = 0; layer < layers; ++layer)
        spread_values[(size_t)layer * count + i] = (float4)(0.0f);
    if (!fits[patch])
        return;
    Anchor anchors[AROUND];
    const int found = anchors_of(patch, texel_to_patch, resolution, width, atlases, texels, groups, leaders, receivers,
                                 light, anchors);
    float inverse[6], counts[AROUND];
    weigh(anchors, found, inverse, counts);
    for (int layer = 0; layer < layers; ++layer) {
        float4 sum = (float4)(0.0f);
        for (int k = 0; k < found; ++k)
            sum += counts[k] * values[(size_t)layer * group_count + anchors[k].group];
        spread_values[(size_t)layer * count + i] = sum;
    }
}
