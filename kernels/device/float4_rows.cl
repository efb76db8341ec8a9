// Unpacks rows of three floats to float4, with `first` zero rows before them and zero rows after.
__kernel void to_float4(__global const float *narrow, __global float4 *wide, const int first, const int values,
                        const int count)
{
    const int i = get_global_id(0);
    if (i < count)
        wide[i] = i < first || i >= first + values ? (float4)(0.0f) : (float4)(vload3(i - first, narrow), 0.0f);
}

// Unpacks rgb from rows that are `stride` floats apart to float4.
__kernel void widen_rows(__global const float *rows, const int stride, __global float4 *wide, const int count)
{
    const int i = get_global_id(0);
    if (i < count)
        wide[i] = (float4)(vload3(0, rows + (size_t)stride * i), 0.0f);
}

// Packs float4 to three floats. Input: `planes` float4 per item; output: one plane of items after another.
__kernel void to_float3(__global const float4 *wide, const int planes, const int items, __global float *narrow)
{
    const int i = get_global_id(0);
    if (i < planes * items)
        vstore3(wide[i].xyz, (size_t)(i % planes) * items + i / planes, narrow);
}

// Scatters (n, 3) float colours to float4 rows first + places[i].
__kernel void scatter_colours(__global const float *colors, __global const uint *places, const int first,
                              __global float4 *wide, const int count)
{
    const int i = get_global_id(0);
    if (i < count)
        wide[first + places[i]] = (float4)(vload3(i, colors), 0.0f);
}

// Scatters rows of `columns` floats to rows places[i] of another array.
__kernel void put_rows(__global const float *values, __global const uint *places, const int columns,
                       __global float *rows, const int count)
{
    const int i = get_global_id(0);
    for (int column = 0; i < count && column < columns; ++column)
        rows[(size_t)places[i] * columns + column] = values[(size_t)i * columns + column];
}

// Stores the numbers at some places.
__kernel void take_numbers(__global const uint *numbers, __global const int *places, __global uint *taken,
                           const int count)
{
    const int i = get_global_id(0);
    if (i < count)
        taken[i] = numbers[places[i]];
}

// Inserts rows into an array of rows of `columns` words. Row k of `others` becomes row inserted[k] of the result;
// `inserted` is ascending. Each row finds its source by binary search.
__kernel void insert_rows(__global const uint *rows, __global const uint *others, __global const int *inserted,
                          const int number, const int columns, __global uint *joined, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    int before = 0, last = number;
    while (before < last) {
        const int middle = before + (last - before) / 2;
        if (inserted[middle] < i)
            before = middle + 1;
        else
            last = middle;
    }
    const bool is_new = before < number && inserted[before] == i;
    __global const uint *source = is_new ? others + before * columns : rows + (i - before) * columns;
    for (int column = 0; column < columns; ++column)
        joined[i * columns + column] = source[column];
}

// Sets the first `channels` floats of some rows, `stride` apart, to 0.
__kernel void blacken(__global float *rows, const int stride, const int channels, __global const uint *places,
                      const int count)
{
    const int i = get_global_id(0);
    for (int channel = 0; i < count && channel < channels; ++channel)
        rows[(size_t)stride * places[i] + channel] = 0.0f;
}

// Sets w of each float4 to 0.
__kernel void clear_fourth(__global float4 *wide, const int count)
{
    const int i = get_global_id(0);
    if (i < count)
        wide[i].w = 0.0f;
}

// Sums rgb of rows that are `stride` floats apart (at least 3).
__kernel void sum_channels(__global const float *rows, const int stride, __global float *sums, const int count)
{
    const int i = get_global_id(0);
    if (i < count) {
        const float3 color = vload3(0, rows + (size_t)stride * i);
        sums[i] = color.x + color.y + color.z;
    }
}

// Extracts w of each float4.
__kernel void take_fourth(__global const float4 *wide, __global float *taken, const int count)
{
    const int i = get_global_id(0);
    if (i < count)
        taken[i] = wide[i].w;
}

// Gathers the first `channels` floats of the chosen rows, `stride` apart, into a packed array.
__kernel void take_colors(__global const float *rows, const int stride, const int channels, __global const uint *chosen,
                          __global float *taken, const int count)
{
    const int i = get_global_id(0);
    for (int channel = 0; i < count && channel < channels; ++channel)
        taken[(size_t)channels * i + channel] = rows[(size_t)stride * chosen[i] + channel];
}

// Adds two colour arrays, the second times `sign`, with rows `stride` and `apart` floats apart. Stores max(sum, 0) as
// float4.
__kernel void add_colors(__global const float *rows, const int stride, __global const float *others, const int apart,
                         const float sign, __global float4 *total, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const float3 sum = vload3(0, rows + (size_t)stride * i) + sign * vload3(0, others + (size_t)apart * i);
    total[i] = (float4)(fmax(sum, 0.0f), 0.0f);
}
