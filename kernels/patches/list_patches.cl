// Compaction of images to ascending lists: patches of covered texels, and border texels. Each work item lists the
// entries of SEGMENT consecutive texels of one image, from the number of entries before them.

#define SEGMENT 32
#define ONLY_TOUCHED 0x80000000u  // marks texels that a triangle touches without covering the centre

// Returns the range of texels of this work item within all images; an empty range for surplus items.
int2 segment_of(const int texels)
{
    const int first = get_global_id(0) * SEGMENT, last = min(first + SEGMENT, texels);
    const int image = get_global_id(1) * texels;
    return first < texels ? (int2)(image + first, image + last) : (int2)(0, 0);
}

int segment_number(const int texels) { return get_global_id(1) * ((texels + SEGMENT - 1) / SEGMENT) + get_global_id(0); }

// Returns true if an entry is listed: entries of patches, which are not 0 and lack ONLY_TOUCHED, or, if `masked`, all
// that are not 0 where the mask is 0.
bool is_listed(const uint entry, __global const uint *mask, const int masked, const int i)
{
    return masked ? entry != 0 && mask[i] == 0 : (int)entry > 0;
}

// Counts the entries of each segment that are listed.
__kernel void count_entries(__global const uint *entries, __global const uint *mask, const int masked,
                            __global int *counts, const int texels)
{
    const int2 range = segment_of(texels);
    int count = 0;
    for (int i = range.x; i < range.y; ++i)
        count += is_listed(entries[i], mask, masked, i);
    if (range.x < range.y)
        counts[segment_number(texels)] = count;
}

// Lists places and values - 1 of the entries that `count_entries` counts. firsts: number of entries before each segment.
__kernel void list_entries(__global const uint *entries, __global const uint *mask, const int masked,
                           __global const int *firsts, __global int *places, __global int *values, const int texels)
{
    const int2 range = segment_of(texels);
    int place = range.x < range.y ? firsts[segment_number(texels)] : 0;
    for (int i = range.x; i < range.y; ++i)
        if (is_listed(entries[i], mask, masked, i)) {
            places[place] = i;
            values[place++] = (entries[i] & ~ONLY_TOUCHED) - 1;
        }
}

// Replaces the numbers of drawn triangles of one image by triangles + 1. first: first texel of the image. start: index of
// the first triangle in the image, if they are adjacent. order: indices of the triangles if `ordered`, else unused.
__kernel void number_triangles(__global uint *numbers, const int first, const int start, __global const int *order,
                               const int ordered, const int texels)
{
    const int i = get_global_id(0);
    if (i >= texels || numbers[first + i] == 0)
        return;
    const uint number = numbers[first + i] & ~ONLY_TOUCHED, touched = numbers[first + i] & ONLY_TOUCHED;
    numbers[first + i] = touched | (ordered ? order[number - 1] + 1 : number + start);
}

// Returns the barycentrics of a patch from the first two. On slivers the rasterizer interpolates values outside the
// triangle or NaN; these are clamped.
float3 on_triangle(const float2 drawn)
{
    const float3 weights = (float3)(drawn, 1.0f - drawn.x - drawn.y);
    if (weights.x >= 0.0f && weights.y >= 0.0f && weights.z >= 0.0f)
        return weights;
    const float3 inside = fmin(fmax(weights, 0.0f), 1.0f);
    const float total = inside.x + inside.y + inside.z;
    return total > 0.0f ? inside / total : (float3)(1.0f / 3.0f);
}

// Lists the patches of covered texels. numbers: triangle + 1 of each texel, with ONLY_TOUCHED, or 0. weights: two
// barycentrics of each texel. own: patch + 1 of each texel, or 0. counts: number of patches on each triangle, initially
// 0.
__kernel void list_patches(__global const uint *numbers, __global const float *weights, __global const int *firsts,
                           __global int *texel, __global int *triangle, __global float *barycentric,
                           __global uint *own, __global int *counts, const int texels)
{
    const int2 range = segment_of(texels);
    int patch = range.x < range.y ? firsts[segment_number(texels)] : 0;

    // One atomic operation for each run of texels of a triangle.
    uint last = 0;
    int run = 0;
    for (int i = range.x; i < range.y; ++i) {
        const uint number = (int)numbers[i] > 0 ? numbers[i] : 0;
        if (number != last && run > 0) {
            atomic_add(counts + last - 1, run);
            run = 0;
        }
        last = number;
        own[i] = number ? patch + 1 : 0;
        if (number == 0)
            continue;
        texel[patch] = i - (int)get_global_id(1) * texels;
        triangle[patch] = number - 1;
        vstore3(on_triangle(vload2(i, weights)), patch, barycentric);
        ++patch;
        ++run;
    }
    if (run > 0)
        atomic_add(counts + last - 1, run);
}
