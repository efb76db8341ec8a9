#include "bilinear_taps.cl"

// Values of supersampled texels (engine/postprocess/texel_means.py). A texel gets the mean of its valid samples. If
// geometry crosses it, a plane fitted to the samples of 3 x 3 texels is evaluated at its centre. Beside such texels,
// values are fitted so that the bilinear display matches the samples.
//
// Supersampled texels are numbered by flat index, and their samples are sorted alike: texel i has samples from
// firsts[i] on. numbers[flat index] is the texel's number + 1, or 0. A sample is float4: position on the lightmap in
// texels (xy) and weight (z). The weight is positive if the sample is visible, negative if it is invalid, and 0 if
// unused.

// Flags of texels.
#define SEEN 1     // at least one valid sample
#define HIDES 2    // a sample is invalid or was pushed off geometry
#define MOSTLY 4   // at least half of the samples are valid
#define CUT 8      // HIDES, or a neighbour is invalid: a plane is fitted
#define BEYOND 16  // invalid, next to a mostly valid texel with a plane

#define LIT (SEEN | BEYOND)

// Weight, as a fraction of the texel's heaviest sample, below which a sample was pushed off geometry.
#define MOVED 0.01f

// Variance added to sample positions, texels squared: slopes from less spread are noise.
#define STEADY 0.003f

// Maximum extrapolation by slope, in standard deviations of the sample positions.
#define FARTHEST 1.4f

// Maximum extrapolation beyond the range of nearby samples, as a fraction of that range: for planes, which are
// evaluated up to a texel away, and for texels fitted to the samples that read them.
#define BEYOND_PLANE 1.0f
#define BEYOND_READERS 2.0f

// Weight of a fitted texel's previous value, in samples (regularisation).
#define BEFORE 0.01f

// Returns true for texels fitted to the samples that read them, because they have few valid samples or none.
bool is_fitted(const uchar state) { return state & BEYOND || ((state & CUT) && !(state & MOSTLY)); }

// Declares column and row of a texel.
#define COLUMN_AND_ROW(texel) const int column = (texel) % resolution, row = (texel) / resolution % resolution

// Loop over the 3 x 3 texels around the current one, within the lightmap. `there`: number of the texel, or -1.
#define AROUND \
    for (int up = max(-1, -row); up <= min(1, resolution - 1 - row); ++up) \
        for (int right = max(-1, -column); right <= min(1, resolution - 1 - column); ++right)
#define NUMBER_AT(texel) ((int)numbers[(texel) + (uint)(up * resolution + right)] - 1)

// Position of a sample relative to the centre of the current texel.
#define PLACE(sample) ((sample).xy - (float2)(column + 0.5f, row + 0.5f))

// Returns the value of a sample, from rows of `stride` floats: 1 for scalars, at least 3 for colours.
float4 value_of(__global const float *values, const int stride, const int sample)
{
    return stride == 1 ? (float4)(values[sample]) : (float4)(vload3(0, values + (size_t)stride * sample), 0.0f);
}

// Adds a value to a sum with Kahan compensation (Kahan 1965).
void add_to(float4 *sum, float4 *left, const float4 value)
{
    const float4 wanted = value - *left, total = *sum + wanted;
    *left = (total - *sum) - wanted;
    *sum = total;
}

// Packs position and weight of each sample into a float4.
__kernel void list_samples(__global const float *positions, __global const float *weights,
                           __global const uchar *visible, __global float4 *samples, const int count)
{
    const int k = get_global_id(0);
    if (k < count)
        samples[k] = (float4)(vload2(k, positions), visible[k] ? weights[k] : -weights[k], 0.0f);
}

// Computes the total weight and mean position of each texel's valid samples, and its flags.
__kernel void look_at_texels(__global const float4 *samples, __global const int *firsts, __global const uint *texels,
                             const int resolution, __global uint *numbers, __global float4 *seen_part,
                             __global uchar *states, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    COLUMN_AND_ROW(texels[i]);
    float heaviest = 0.0f;
    int number = 0;
    for (int k = firsts[i]; k < firsts[i + 1]; ++k) {
        heaviest = fmax(heaviest, samples[k].z);
        number += samples[k].z != 0.0f;
    }
    float4 sum = (float4)(0.0f), left = (float4)(0.0f);
    int whole = 0;
    for (int k = firsts[i]; k < firsts[i + 1]; ++k) {
        const float weight = samples[k].z;
        if (weight <= 0.0f)
            continue;
        add_to(&sum, &left, weight * (float4)(1.0f, PLACE(samples[k]), 0.0f));
        whole += weight > MOVED * heaviest;
    }
    numbers[texels[i]] = i + 1;
    seen_part[i] = heaviest > 0.0f ? (float4)(sum.x, sum.yz / sum.x, 0.0f) : (float4)(0.0f);
    states[i] = heaviest > 0.0f ? SEEN | (whole < number ? HIDES : 0) | (2 * whole >= number ? MOSTLY : 0) : 0;
}

// Marks valid texels that need a plane: geometry crosses them, or a neighbour is invalid.
__kernel void mark_cut(__global const uint *texels, __global const uint *numbers, const int resolution,
                       __global const uchar *states, __global uchar *marked, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    bool cut = states[i] & HIDES;
    COLUMN_AND_ROW(texels[i]);
    AROUND
    {
        const int other = NUMBER_AT(texels[i]);
        cut |= other >= 0 && !(states[other] & SEEN);
    }
    marked[i] = states[i] | ((states[i] & SEEN) && cut ? CUT : 0);
}

// Marks invalid texels next to a mostly valid texel with a plane; bilinear look-ups read them.
__kernel void mark_extrapolated(__global const uint *texels, __global const uint *numbers, const int resolution,
                                __global const uchar *states, __global uchar *marked, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    bool near = false;
    COLUMN_AND_ROW(texels[i]);
    AROUND
    {
        const int other = NUMBER_AT(texels[i]);
        near |= other >= 0 && (states[other] & CUT) && (states[other] & MOSTLY);
    }
    marked[i] = states[i] | (!(states[i] & SEEN) && near ? BEYOND : 0);
}

// Computes the mean, minimum and maximum of each texel's valid samples; `light` is 0 if there are none.
__kernel void texel_means(__global const float4 *samples, __global const int *firsts, __global const float4 *seen_part,
                          __global const float *values, const int stride, __global float4 *light,
                          __global float4 *low, __global float4 *high, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    float4 sum = (float4)(0.0f), left = (float4)(0.0f);
    float4 least = (float4)(INFINITY), most = (float4)(-INFINITY);
    for (int k = firsts[i]; k < firsts[i + 1]; ++k) {
        if (samples[k].z <= 0.0f)
            continue;
        const float4 value = value_of(values, stride, k);
        add_to(&sum, &left, samples[k].z / seen_part[i].x * value);
        least = fmin(least, value);
        most = fmax(most, value);
    }
    light[i] = sum;
    low[i] = least;
    high[i] = most;
}

// Maps floats to integers of the same order, and back.
int4 ordered(const float4 v)
{
    const int4 bits = as_int4(v);
    return bits ^ (bits >> 31 & 0x7fffffff);
}
float4 unordered(const int4 bits) { return as_float4(bits ^ (bits >> 31 & 0x7fffffff)); }

// Finds minimum and maximum of all valid samples per channel by atomics. Each work item processes EACH texels.
#define EACH 32
__kernel void range_of_all(__global const float4 *low, __global const float4 *high, __global int *range,
                           const int count)
{
    float4 least = (float4)(INFINITY), most = (float4)(-INFINITY);
    for (int k = 0; k < EACH; ++k) {
        const int i = k * get_global_size(0) + get_global_id(0);
        if (i < count) {
            least = fmin(least, low[i]);
            most = fmax(most, high[i]);
        }
    }
    const int4 first = ordered(least), last = ordered(most);
    atomic_min(range, first.x), atomic_min(range + 1, first.y), atomic_min(range + 2, first.z);
    atomic_max(range + 4, last.x), atomic_max(range + 5, last.y), atomic_max(range + 6, last.z);
}

// Fits a plane around each cut texel by weighted least squares over the samples of 3 x 3 texels: level at the centre,
// slopes along u and v, and the range of values. Geometry in the texel displaces the mean of its valid samples from the
// centre, so the value is extrapolated back along the slope. The distance is limited to a Mahalanobis distance of
// FARTHEST, because slopes across a narrow strip of samples are noise.
__kernel void fit_planes(__global const float4 *samples, __global const int *firsts, __global const uint *texels,
                         __global const uint *numbers, const int resolution, __global const uchar *states,
                         __global const float4 *seen_part, __global const float *values, const int stride,
                         __global const float4 *low, __global const float4 *high, __global const int *range,
                         __global float4 *light, __global float4 *planes, const int count)
{
    const int i = get_global_id(0);
    if (i >= count || !(states[i] & CUT))
        return;

    // Compute means of positions and values; all sums below are relative to them.
    float total = 0.0f;
    float2 middle = (float2)(0.0f);
    float4 mean = (float4)(0.0f), least = (float4)(INFINITY), most = (float4)(-INFINITY);
    COLUMN_AND_ROW(texels[i]);
    AROUND
    {
        const int other = NUMBER_AT(texels[i]);
        if (other < 0 || !(states[other] & SEEN))
            continue;
        least = fmin(least, low[other]);
        most = fmax(most, high[other]);
        for (int k = firsts[other]; k < firsts[other + 1]; ++k) {
            const float weight = fmax(samples[k].z, 0.0f);
            total += weight;
            middle += weight * PLACE(samples[k]);
            mean += weight == 0.0f ? (float4)(0.0f) : weight * value_of(values, stride, k);
        }
    }
    middle /= total;
    mean /= total;
    float3 spread = (float3)(0.0f);  // along u, along both, along v
    float4 right_side_u = (float4)(0.0f), right_side_v = (float4)(0.0f);
    AROUND
    {
        const int other = NUMBER_AT(texels[i]);
        if (other < 0 || !(states[other] & SEEN))
            continue;
        for (int k = firsts[other]; k < firsts[other + 1]; ++k) {
            if (samples[k].z <= 0.0f)
                continue;
            const float part = samples[k].z / total;
            const float2 off = PLACE(samples[k]) - middle;
            const float4 more = part * (value_of(values, stride, k) - mean);
            spread += part * (float3)(off.x * off.x, off.x * off.y, off.y * off.y);
            right_side_u += off.x * more;
            right_side_v += off.y * more;
        }
    }

    // The inverse covariance of positions gives the slopes and the Mahalanobis distance.
    spread.xz += STEADY;
    const float3 inverse = (float3)(spread.z, -spread.y, spread.x) / (spread.x * spread.z - spread.y * spread.y);
    const float4 slope_u = inverse.x * right_side_u + inverse.y * right_side_v;
    const float4 slope_v = inverse.y * right_side_u + inverse.z * right_side_v;
    const float4 beyond = BEYOND_PLANE * (most - least);
    least = fmax(least - beyond, unordered(vload4(0, range)));
    most = fmin(most + beyond, unordered(vload4(1, range)));
    planes[5 * i] = mean - middle.x * slope_u - middle.y * slope_v;
    planes[5 * i + 1] = slope_u;
    planes[5 * i + 2] = slope_v;
    planes[5 * i + 3] = least;
    planes[5 * i + 4] = most;
    if (states[i] & HIDES) {
        const float2 way = seen_part[i].yz;
        const float far = inverse.x * way.x * way.x + 2.0f * inverse.y * way.x * way.y + inverse.z * way.y * way.y;
        const float part = FARTHEST / sqrt(fmax(far, FARTHEST * FARTHEST));
        light[i] = clamp(light[i] - part * (way.x * slope_u + way.y * slope_v), least, most);
    }
}

// Sets invalid texels beside valid ones to the mean of the planes extrapolated to them.
__kernel void extrapolate_texels(__global const uint *texels, __global const uint *numbers, const int resolution,
                                 __global const uchar *states, __global const float4 *planes, __global float4 *light,
                                 const int count)
{
    const int i = get_global_id(0);
    if (i >= count || !(states[i] & BEYOND))
        return;
    float4 sum = (float4)(0.0f);
    float number = 0.0f;
    COLUMN_AND_ROW(texels[i]);
    AROUND
    {
        const int other = NUMBER_AT(texels[i]);
        if (other < 0 || !(states[other] & CUT) || !(states[other] & MOSTLY))
            continue;
        __global const float4 *plane = planes + 5 * other;
        sum += clamp(plane[0] - (float)right * plane[1] - (float)up * plane[2], plane[3], plane[4]);
        number += 1.0f;
    }
    light[i] = sum / number;
}

// Bilinear taps of a sample: numbers of the four texels, -1 for texels with weight 0.
typedef struct {
    int number[4];
    float weight[4];
    float fitted;  // weight of the texels that are fitted
    bool counts;   // all are lit, and the sample is not beyond the border of the lightmap
} Reading;

Reading reading_at(const float2 position, const int atlas, __global const uint *numbers, const int resolution,
                   __global const uchar *states)
{
    Reading reading = {{-1, -1, -1, -1}, {0.0f, 0.0f, 0.0f, 0.0f}, 0.0f, true};
    const Footprint footprint = footprint_at(position, resolution);
    const float2 off = fabs(position - 0.5f * resolution);
    reading.counts = fmax(off.x, off.y) <= 0.5f * resolution - 0.5f;
    for (int corner = 0; corner < 4; ++corner) {
        const float weight = weight_of(&footprint, corner);
        if (weight == 0.0f)
            continue;
        const int number = (int)numbers[flat_index(atlas, corner_of(&footprint, corner), resolution)] - 1;
        const uchar state = number < 0 ? 0 : states[number];
        reading.number[corner] = number;
        reading.weight[corner] = weight;
        reading.fitted += is_fitted(state) ? weight : 0.0f;
        reading.counts &= (state & LIT) != 0;
    }
    return reading;
}

// Returns the weight with which a sample constrains texel i: bilinear weight times sample weight; 0 if it is invalid or
// unused.
float share_of(const float4 sample, const int i, const int atlas, __global const uint *numbers, const int resolution,
               __global const uchar *states, Reading *reading)
{
    if (sample.z <= 0.0f)
        return 0.0f;
    *reading = reading_at(sample.xy, atlas, numbers, resolution, states);
    float weight = 0.0f;
    for (int corner = 0; corner < 4; ++corner)
        weight += reading->number[corner] == i ? reading->weight[corner] : 0.0f;
    return reading->counts ? weight * sample.z : 0.0f;
}

// Prepares the least-squares fit of the display to the samples (Kavan, Bargteil and Sloan 2011): bounds and Jacobi step
// sizes of the fitted texels.
__kernel void begin_fit(__global const float4 *samples, __global const int *firsts, __global const uint *texels,
                        __global const uint *numbers, const int resolution, __global const uchar *states,
                        __global const float *values, const int stride, __global const int *range,
                        __global const float4 *light, __global float4 *low, __global float4 *high,
                        __global float *steps, const int count)
{
    const int i = get_global_id(0);
    if (i >= count || !is_fitted(states[i]))
        return;
    const int atlas = texels[i] / (resolution * resolution);
    float4 least = light[i], most = light[i];
    float total = 0.0f;
    COLUMN_AND_ROW(texels[i]);
    AROUND
    {
        const int other = NUMBER_AT(texels[i]);
        for (int k = other < 0 ? 0 : firsts[other]; other >= 0 && k < firsts[other + 1]; ++k) {
            Reading reading;
            const float share = share_of(samples[k], i, atlas, numbers, resolution, states, &reading);
            if (share == 0.0f)
                continue;
            const float4 value = value_of(values, stride, k);
            least = fmin(least, value);
            most = fmax(most, value);
            total += share * reading.fitted;
        }
    }
    const float4 beyond = BEYOND_READERS * (most - least);
    low[i] = fmax(least - beyond, unordered(vload4(0, range)));
    high[i] = fmin(most + beyond, unordered(vload4(1, range)));
    steps[i] = 1.0f / (total + BEFORE);
}

// Runs one Jacobi step on the fitted texels, clamped to their bounds. Other texels are copied.
__kernel void step_of_fit(__global const float4 *samples, __global const int *firsts, __global const uint *texels,
                          __global const uint *numbers, const int resolution, __global const uchar *states,
                          __global const float *values, const int stride, __global const float4 *low,
                          __global const float4 *high, __global const float *steps, __global const float4 *light,
                          __global float4 *changed, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    if (!is_fitted(states[i])) {
        changed[i] = light[i];
        return;
    }
    const int atlas = texels[i] / (resolution * resolution);
    float4 change = (float4)(0.0f);
    COLUMN_AND_ROW(texels[i]);
    AROUND
    {
        const int other = NUMBER_AT(texels[i]);
        for (int k = other < 0 ? 0 : firsts[other]; other >= 0 && k < firsts[other + 1]; ++k) {
            Reading reading;
            const float share = share_of(samples[k], i, atlas, numbers, resolution, states, &reading);
            if (share == 0.0f)
                continue;
            float4 off = value_of(values, stride, k);
            for (int corner = 0; corner < 4; ++corner)
                if (reading.number[corner] >= 0)
                    off -= reading.weight[corner] * light[reading.number[corner]];
            change += share * off;
        }
    }
    changed[i] = clamp(light[i] + steps[i] * change, low[i], high[i]);
}
