// Vectors of three numbers, close together in memory, become float4, `first` zeros before them and more after.
__kernel void widen(__global const float *narrow, __global float4 *wide, const int first, const int values,
                    const int count)
{
    const int i = get_global_id(0);
    if (i < count)
        wide[i] = i < first || i >= first + values ? (float4)(0.0f) : (float4)(vload3(i - first, narrow), 0.0f);
}

// The colours of `planes` float4 of each item, one plane after the other, three floats each.
__kernel void narrow(__global const float4 *wide, const int planes, const int items, __global float *narrow)
{
    const int i = get_global_id(0);
    if (i < planes * items)
        vstore3(wide[i].xyz, (size_t)(i % planes) * items + i / planes, narrow);
}
