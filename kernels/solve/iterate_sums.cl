#include "colour_sums.cl"

// Reductions and mixing for Anderson acceleration (engine/solve/anderson.py) over a ring of COLUMNS iterates. `newest`
// is the ring index of the latest iterate; columns not yet filled are zero.

#define PRODUCTS (COLUMNS * (COLUMNS - 1) / 2)
#define SUMS (PRODUCTS + COLUMNS + 3)

// Accumulates the inner products that Anderson acceleration needs, per channel, for each work item.
// First the products D_i D_j, D_i f and f f of defect differences D to the newest defect f, weighted by the inverse
// square of the patch's irradiance, at least `least`. Then the reflected flux of f, the reflected flux of unit ambient
// light, and in x the total irradiance.
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

// Computes the next irradiance: a weighted mix of the iterates plus ambient light, weights[COLUMNS], times the fraction
// of visible patches. sums: absolute change; relative change of the first `fronts` patches; added flux.
__kernel void mix_iterates(__global const float4 *gathered, __global const float4 *weights,
                           __global const float *patches_seen, __global const float4 *reflectance,
                           __global const float *area, const float least, const int fronts, const int count,
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

// Computes the flux balance, area-weighted: incident flux, reflected flux, flux lost to the background, flux lost to
// back faces, flux from sources, and flux of the newest defect that is not bounced yet. One partial sum per work item.
__kernel void balance(__global const float4 *gathered, __global const float4 *defects, const int newest,
                      __global const float4 *reflectance, __global const float4 *emitted, __global const float4 *direct,
                      __global const float *area, __global const float *patches_seen, const int count,
                      __global float4 *sums)
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

// Sums the partial sums of all work items in a fixed order, so that results are deterministic. One work group per
// number.
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
