#include "colour_sums.cl"

// Sums over all patches and mixtures of iterates, for Anderson's acceleration (engine/solve/anderson.py).
// COLUMNS is the number of iterates kept. The newest one is `newest` of the ring; those that are not
// valid yet hold zeros.

#define PRODUCTS (COLUMNS * (COLUMNS - 1) / 2)
#define SUMS (PRODUCTS + COLUMNS + 3)

// For each channel: products of the defects' differences to the newest, D_i D_j and D_i f, and f f, with
// weights that fall with the square of a patch's light above the mean; then what the patches reflect of
// the newest defect, and of light that is 1 wherever they see others; then all light, in x. One sum for
// each work item.
__kernel void iterate_products(__global const float4 *gathered, __global const float4 *defects, const int newest,
                               __global const float4 *reflectance, __global const float *area,
                               __global const float *patches_seen, const float least, const int count,
                               __global float4 *sums)
{
    float4 acc[SUMS];
#pragma unroll
    for (int k = 0; k < SUMS; ++k)
        acc[k] = (float4)(0.0f);
    for (int i = get_global_id(0); i < count; i += get_global_size(0)) {
        const float4 f = defects[(size_t)newest * count + i];
        const float total = sum3(gathered[(size_t)newest * count + i]);
        const float root = 1.0f / fmax(total, least), weight = root * root;
        float4 difference[COLUMNS];
#pragma unroll
        for (int j = 0; j < COLUMNS; ++j)
            difference[j] = j == newest ? f : defects[(size_t)j * count + i] - f;
        int k = 0;
#pragma unroll
        for (int a = 0; a < COLUMNS; ++a)
#pragma unroll
            for (int b = a; b < COLUMNS; ++b, ++k)
                acc[k] += weight * difference[a] * difference[b];
        const float4 reflecting = area[i] * reflectance[i];
        acc[PRODUCTS + COLUMNS] += reflecting * f;
        acc[PRODUCTS + COLUMNS + 1] += reflecting * patches_seen[i];
        acc[PRODUCTS + COLUMNS + 2].x += total;
    }
#pragma unroll
    for (int k = 0; k < SUMS; ++k)
        sums[k * get_global_size(0) + get_global_id(0)] = acc[k];
}

// The next irradiance: iterates mixed, and the ambient light behind their weights where patches see others.
// Sums: the change, the change of the first `fronts` patches relative to each one's own light, and the flux that is
// added.
__kernel void mix_iterates(__global const float4 *gathered, __global const float4 *weights,
                           __global const float *patches_seen,
                           __global const float4 *reflectance, __global const float *area,
                           const float least, const int fronts, const int count,
                           __global float4 *irradiance, __global float4 *sums)
{
    float4 acc = (float4)(0.0f);
    for (int i = get_global_id(0); i < count; i += get_global_size(0)) {
        float4 next = weights[COLUMNS] * patches_seen[i];
        for (int j = 0; j < COLUMNS; ++j)
            next += weights[j] * gathered[(size_t)j * count + i];
        next = fmax(next, 0.0f);
        const float4 before = irradiance[i];
        const float change = sum3(fabs(next - before));
        const float flux = area[i] * sum3(reflectance[i] * (next - before));
        acc += (float4)(change, i < fronts ? change / fmax(sum3(next), least) : 0.0f, flux, 0.0f);
        irradiance[i] = next;
    }
    sums[get_global_id(0)] = acc;
}

// Where light goes, times area: what arrives, what is reflected of it, what is sent out to where nothing is and
// to backs, what comes from sources, what of the newest defect is under way to other patches. One sum for each
// work item.
__kernel void balance(__global const float4 *gathered, __global const float4 *defects, const int newest,
                      __global const float4 *reflectance, __global const float4 *emitted,
                      __global const float4 *direct, __global const float *area,
                      __global const float *patches_seen, const int count, __global float4 *sums)
{
    float4 acc[6];
    for (int k = 0; k < 6; ++k)
        acc[k] = (float4)(0.0f);
    for (int i = get_global_id(0); i < count; i += get_global_size(0)) {
        const float4 light = gathered[(size_t)newest * count + i];
        const float no_back = light.w, seen = patches_seen[i];
        const float4 reflected = reflectance[i] * light, own = emitted[i + 1], sent = own + reflected;
        acc[0] += area[i] * light;
        acc[1] += area[i] * reflected;
        acc[2] += area[i] * (no_back - seen) * sent;
        acc[3] += area[i] * (1.0f - no_back) * sent;
        acc[4] += area[i] * (direct[i] + (1.0f - seen) * own);
        acc[5] += area[i] * seen * reflectance[i] * defects[(size_t)newest * count + i];
    }
    for (int k = 0; k < 6; ++k)
        sums[k * get_global_size(0) + get_global_id(0)] = acc[k];
}

// The sums of all work items together, in a fixed order; one number a group.
__kernel void add_up(__global const float4 *sums, const int items, __global float4 *totals, __local float4 *partial)
{
    const int item = get_local_id(0), number = get_group_id(0);
    float4 sum = (float4)(0.0f);
    for (int i = item; i < items; i += get_local_size(0))
        sum += sums[number * items + i];
    partial[item] = sum;
    for (int step = get_local_size(0) / 2; step > 0; step /= 2) {
        barrier(CLK_LOCAL_MEM_FENCE);
        if (item < step)
            partial[item] += partial[item + step];
    }
    if (item == 0)
        totals[number] = partial[0];
}
