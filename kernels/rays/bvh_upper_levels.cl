#include "bvh.cl"

// Top levels of the BVH: a top-down tree over the clusters that PLOC leaves (engine/visibility/rays/upper_levels.py).
// All ranges of a level are split at once by the binned surface area heuristic (Wald 2007).
//
// A range is int4: first position in `order`, number of clusters, parent node, and child slot (0 or 1) in the parent. A
// node's number is the position of its last left cluster, so numbers are unique.

#define BINS 16
#define MOST_ITEMS 64  // of a group

float3 centre_of(__global const NodeBox *boxes, const int node)
{
    const float3 low = vload3(0, boxes[node].low);
    return low + (vload3(0, boxes[node].high) - low) / 2.0f;
}

float along(const float3 v, const int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

// Splits each range with one work group: partitions its clusters, stores the new node in its parent's child slot, and
// appends to `ranges` each half of more than one cluster.
__kernel void split_ranges(__global const NodeBox *boxes, __global const NodeLink *links, __global const int *cluster,
                           __global int *order, __global int *parted, __global uchar *bins, __global int4 *ranges,
                           __global int *count_ranges, __global int *numbers, __global int *children,
                           const int first_range, const int first_node)
{
    __local float4 lows[MOST_ITEMS], highs[MOST_ITEMS];
    __local int sizes[BINS], weights[BINS], before[MOST_ITEMS], border, left;
    const int item = get_local_id(0), items = get_local_size(0), place = first_range + get_group_id(0);
    const int4 range = ranges[place];
    const int first = range.x, count = range.y;

    // Find the longest axis of the bounds of cluster centres.
    float3 low = (float3)(INFINITY), high = (float3)(-INFINITY);
    for (int k = item; k < count; k += items) {
        const float3 centre = centre_of(boxes, cluster[order[first + k]]);
        low = fmin(low, centre);
        high = fmax(high, centre);
    }
    lows[item] = (float4)(low, 0.0f);
    highs[item] = (float4)(high, 0.0f);
    for (int step = items / 2; step > 0; step /= 2) {
        barrier(CLK_LOCAL_MEM_FENCE);
        if (item < step) {
            lows[item] = fmin(lows[item], lows[item + step]);
            highs[item] = fmax(highs[item], highs[item + step]);
        }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    const float3 start = lows[0].xyz, extent = highs[0].xyz - start;
    const int axis = extent.x >= fmax(extent.y, extent.z) ? 0 : extent.y >= extent.z ? 1 : 2;
    const float from = along(start, axis), width = fmax(along(extent, axis), 1e-30f);

    // Assign clusters to BINS bins along that axis; then sum the box, cluster count and triangle count of each bin.
    for (int k = item; k < count; k += items) {
        const float centre = along(centre_of(boxes, cluster[order[first + k]]), axis);
        bins[first + k] = min((int)((centre - from) / width * BINS), BINS - 1);
    }
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    for (int bin = item; bin < BINS; bin += items) {
        float3 bin_low = (float3)(INFINITY), bin_high = (float3)(-INFINITY);
        int size = 0, weight = 0;
        for (int k = 0; k < count; ++k) {
            if (bins[first + k] != bin)
                continue;
            const int node = cluster[order[first + k]];
            bin_low = fmin(bin_low, vload3(0, boxes[node].low));
            bin_high = fmax(bin_high, vload3(0, boxes[node].high));
            weight += links[node].triangles;
            ++size;
        }
        lows[bin] = (float4)(bin_low, 0.0f);
        highs[bin] = (float4)(bin_high, 0.0f);
        sizes[bin] = size;
        weights[bin] = weight;
    }
    barrier(CLK_LOCAL_MEM_FENCE);

    // Choose the split of least cost by the surface area heuristic. border: last bin of the left half; -1 if all
    // clusters share one bin, then the range is halved by count.
    if (item == 0) {
        float after[BINS];
        float3 bin_low = (float3)(INFINITY), bin_high = (float3)(-INFINITY);
        int weight = 0;
#pragma unroll 1
        for (int bin = BINS - 1; bin > 0; --bin) {
            bin_low = fmin(bin_low, lows[bin].xyz);
            bin_high = fmax(bin_high, highs[bin].xyz);
            weight += weights[bin];
            after[bin] = weight * half_area(fmax(bin_high - bin_low, 0.0f));
        }
        bin_low = (float3)(INFINITY);
        bin_high = (float3)(-INFINITY);
        weight = 0;
        int size = 0;
        float least = INFINITY;
        border = -1;
        left = count / 2;
#pragma unroll 1
        for (int bin = 0; bin < BINS - 1; ++bin) {
            bin_low = fmin(bin_low, lows[bin].xyz);
            bin_high = fmax(bin_high, highs[bin].xyz);
            weight += weights[bin];
            size += sizes[bin];
            const float cost = weight * half_area(fmax(bin_high - bin_low, 0.0f)) + after[bin + 1];
            if (size > 0 && size < count && cost < least) {
                least = cost;
                border = bin;
                left = size;
            }
        }
    }
    barrier(CLK_LOCAL_MEM_FENCE);

    // Partition stably: both halves keep their order. Each work item moves a contiguous part.
#define IS_LEFT(k) (border < 0 ? (k) < left : bins[first + (k)] <= border)
    const int each = (count + items - 1) / items, begin = min(item * each, count), end = min(begin + each, count);
    int lefts = 0;
    for (int k = begin; k < end; ++k)
        lefts += IS_LEFT(k);
    before[item] = lefts;
    barrier(CLK_LOCAL_MEM_FENCE);
    int to_left = first;
    for (int i = 0; i < item; ++i)
        to_left += before[i];
    int to_right = first + left + begin - (to_left - first);
    for (int k = begin; k < end; ++k)
        parted[IS_LEFT(k) ? to_left++ : to_right++] = order[first + k];
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    for (int k = item; k < count; k += items)
        order[first + k] = parted[first + k];

    if (item > 0)
        return;
    const int number = first + left - 1;
    numbers[place] = number;
    if (range.z >= 0)
        children[2 * range.z + range.w] = first_node + number;
    for (int side = 0; side < 2; ++side) {
        const int begins = side ? first + left : first, size = side ? count - left : left;
        if (size == 1)
            children[2 * number + side] = cluster[parted[begins]];
        else
            ranges[atomic_inc(count_ranges)] = (int4)(begins, size, number, side);
    }
}

// Computes box, cost and leaf flag of the nodes of a level from their children.
__kernel void fit_nodes(__global const int *numbers, const int first_range, __global const int *children,
                        const int first_node, __global NodeBox *boxes, __global NodeLink *links, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const int number = numbers[first_range + i];
    join_nodes(boxes, links, first_node + number, children[2 * number], children[2 * number + 1]);
}

// Estimates the number of boxes that a random ray hits (surface area heuristic): the summed area of inner nodes divided
// by the root's area. Runs as one work group.
__kernel void sum_areas(__global const NodeBox *boxes, const int root, const int first_node, __global float *cost,
                        const int count)
{
    __local float sums[MOST_ITEMS];
    const int item = get_local_id(0), items = get_local_size(0);
    float sum = 0.0f;
    for (int i = item; i < count; i += items)
        sum += area_of(boxes, first_node + i);
    sums[item] = sum;
    for (int step = items / 2; step > 0; step /= 2) {
        barrier(CLK_LOCAL_MEM_FENCE);
        if (item < step)
            sums[item] += sums[item + step];
    }
    if (item == 0)
        cost[0] = sums[0] / fmax(area_of(boxes, root), 1e-30f);
}
