#include "bilinear_taps.cl"

// What texels show that have several display samples (engine/postprocess/texel_means.py): the mean of those that are seen;
// where something cuts a texel, what a plane through the samples of 3 x 3 texels has at its centre; beyond that, what
// makes the display right at the samples.
//
// Texels that have samples are numbered in the order of their flat indices, and so are their samples: those of number
// i begin at firsts[i]. numbers[flat index] is the number + 1, 0 for texels without samples. A sample is its place on
// the lightmap, texels, and its weight: positive where it is seen, negative where nobody sees it, 0 if it counts for
// nothing.

// What is known of a texel.
#define SEEN 1      // somebody sees some sample
#define HIDES 2     // some sample is hidden, or was moved out of something
#define MOSTLY 4    // half of the samples are seen, at least
#define CUT 8       // it hides something, or a texel beside it is hidden: it has a plane
#define BEYOND 16   // hidden, beside a texel with a plane that is mostly seen

#define LIT (SEEN | BEYOND)

// A sample that weighs less than this part of the heaviest of its texel was moved out of something.
#define MOVED 0.01f

// Variance of places, texels squared, which light has no slope over: that of noise stays small.
#define STEADY 0.003f

// Light goes on by its slope as far as so many standard deviations of the samples' places, and no farther.
#define FARTHEST 1.4f

// How far light may go on beyond the range of the samples around, in parts of that range: a plane through somewhat more
// than a texel is read up to a texel beyond it. Then the same of texels that suit samples that read them.
#define BEYOND_PLANE 1.0f
#define BEYOND_READERS 2.0f

// Weight of what a texel had before, in samples that stand for a whole texel.
#define BEFORE 0.01f

// Texels whose light suits the samples that read them: hardly any of theirs, or none, tells it.
bool is_fitted(const uchar state) { return state & BEYOND || ((state & CUT) && !(state & MOSTLY)); }

// Where a texel is on its lightmap.
#define COLUMN_AND_ROW(texel) const int column = (texel) % resolution, row = (texel) / resolution % resolution

// Steps to the 3 x 3 texels around one, as far as they are on its lightmap, and the number of the texel there.
#define AROUND \
    for (int up = max(-1, -row); up <= min(1, resolution - 1 - row); ++up) \
        for (int right = max(-1, -column); right <= min(1, resolution - 1 - column); ++right)
#define NUMBER_AT(texel) ((int)numbers[(texel) + (uint)(up * resolution + right)] - 1)

// From the centre of the texel that is looked around: a sample's place.
#define PLACE(sample) ((sample).xy - (float2)(column + 0.5f, row + 0.5f))

float4 value_of(__global const float *values, const int channels, const int sample)
{
    return channels == 1 ? (float4)(values[sample]) : (float4)(vload3(sample, values), 0.0f);
}

// Adds to a sum what rounding has kept out of it (Kahan 1965).
void add_to(float4 *sum, float4 *left, const float4 value)
{
    const float4 wanted = value - *left, total = *sum + wanted;
    *left = (total - *sum) - wanted;
    *sum = total;
}

// Samples as they are above.
__kernel void list_samples(__global const float *positions, __global const float *weights,
                           __global const uchar *visible, __global float4 *samples, const int count)
{
    const int k = get_global_id(0);
    if (k < count)
        samples[k] = (float4)(vload2(k, positions), visible[k] ? weights[k] : -weights[k], 0.0f);
}

// Total weight of the samples that are seen, and where they are on the mean, from the texel's centre.
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

// A texel needs a plane.
__kernel void mark_cut(__global const uint *texels, __global const uint *numbers, const int resolution,
                       __global const uchar *states, __global uchar *marked, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    bool cut = states[i] & HIDES;
    COLUMN_AND_ROW(texels[i]);
    AROUND {
        const int other = NUMBER_AT(texels[i]);
        cut |= other >= 0 && !(states[other] & SEEN);
    }
    marked[i] = states[i] | ((states[i] & SEEN) && cut ? CUT : 0);
}

// A hidden texel is read by what is seen beside it.
__kernel void mark_extrapolated(__global const uint *texels, __global const uint *numbers, const int resolution,
                                __global const uchar *states, __global uchar *marked, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    bool near = false;
    COLUMN_AND_ROW(texels[i]);
    AROUND {
        const int other = NUMBER_AT(texels[i]);
        near |= other >= 0 && (states[other] & CUT) && (states[other] & MOSTLY);
    }
    marked[i] = states[i] | (!(states[i] & SEEN) && near ? BEYOND : 0);
}

// Means, and the least and the largest value of what is seen; `light` is 0 where nothing is.
__kernel void texel_means(__global const float4 *samples, __global const int *firsts,
                          __global const float4 *seen_part, __global const float *values, const int channels,
                          __global float4 *light, __global float4 *low, __global float4 *high, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    float4 sum = (float4)(0.0f), left = (float4)(0.0f);
    float4 least = (float4)(INFINITY), most = (float4)(-INFINITY);
    for (int k = firsts[i]; k < firsts[i + 1]; ++k) {
        if (samples[k].z <= 0.0f)
            continue;
        const float4 value = value_of(values, channels, k);
        add_to(&sum, &left, samples[k].z / seen_part[i].x * value);
        least = fmin(least, value);
        most = fmax(most, value);
    }
    light[i] = sum;
    low[i] = least;
    high[i] = most;
}

// Numbers as integers in the same order, and back.
int4 ordered(const float4 v) { const int4 bits = as_int4(v); return bits ^ (bits >> 31 & 0x7fffffff); }
float4 unordered(const int4 bits) { return as_float4(bits ^ (bits >> 31 & 0x7fffffff)); }

// The range of all values that are seen: least, then most, of each channel. A work item looks at EACH texels.
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

// Planes around cut texels, of the least weighted squares to the samples of 3 x 3 texels: `level` at the centre, slopes
// along u and v, and how low and high light may go on. What hides something in a texel has moved the mean of the rest
// off its centre: it goes on to there, no farther than a Mahalanobis distance of FARTHEST, since slopes across a strip
// of samples are those of its noise.
__kernel void fit_planes(__global const float4 *samples, __global const int *firsts, __global const uint *texels,
                         __global const uint *numbers, const int resolution, __global const uchar *states,
                         __global const float4 *seen_part, __global const float *values, const int channels,
                         __global const float4 *low, __global const float4 *high, __global const int *range,
                         __global float4 *light, __global float4 *planes, const int count)
{
    const int i = get_global_id(0);
    if (i >= count || !(states[i] & CUT))
        return;

    // Means of places and values, which all sums below are about.
    float total = 0.0f;
    float2 middle = (float2)(0.0f);
    float4 mean = (float4)(0.0f), least = (float4)(INFINITY), most = (float4)(-INFINITY);
    COLUMN_AND_ROW(texels[i]);
    AROUND {
        const int other = NUMBER_AT(texels[i]);
        if (other < 0 || !(states[other] & SEEN))
            continue;
        least = fmin(least, low[other]);
        most = fmax(most, high[other]);
        for (int k = firsts[other]; k < firsts[other + 1]; ++k) {
            const float weight = fmax(samples[k].z, 0.0f);
            total += weight;
            middle += weight * PLACE(samples[k]);
            mean += weight == 0.0f ? (float4)(0.0f) : weight * value_of(values, channels, k);
        }
    }
    middle /= total;
    mean /= total;
    float3 spread = (float3)(0.0f);  // along u, along both, along v
    float4 right_side_u = (float4)(0.0f), right_side_v = (float4)(0.0f);
    AROUND {
        const int other = NUMBER_AT(texels[i]);
        if (other < 0 || !(states[other] & SEEN))
            continue;
        for (int k = firsts[other]; k < firsts[other + 1]; ++k) {
            if (samples[k].z <= 0.0f)
                continue;
            const float part = samples[k].z / total;
            const float2 off = PLACE(samples[k]) - middle;
            const float4 more = part * (value_of(values, channels, k) - mean);
            spread += part * (float3)(off.x * off.x, off.x * off.y, off.y * off.y);
            right_side_u += off.x * more;
            right_side_v += off.y * more;
        }
    }

    // The inverse of the places' covariance gives the slopes, and distances along them.
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

// Hidden texels beside what is seen show the mean of the planes that go on there.
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
    AROUND {
        const int other = NUMBER_AT(texels[i]);
        if (other < 0 || !(states[other] & CUT) || !(states[other] & MOSTLY))
            continue;
        __global const float4 *plane = planes + 5 * other;
        sum += clamp(plane[0] - (float)right * plane[1] - (float)up * plane[2], plane[3], plane[4]);
        number += 1.0f;
    }
    light[i] = sum / number;
}

// What a sample reads: numbers of the texels of its footprint, -1 for those without weight.
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

// How much a sample tells of texel i: the weight with which it reads it, times its own; 0 where it is not seen or does
// not count.
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

// Least squares of the display at samples (Kavan, Bargteil and Sloan 2011): between what fitted texels stay, and the
// length of their steps by Jacobi's method.
__kernel void begin_fit(__global const float4 *samples, __global const int *firsts, __global const uint *texels,
                        __global const uint *numbers, const int resolution, __global const uchar *states,
                        __global const float *values, const int channels, __global const int *range,
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
    AROUND {
        const int other = NUMBER_AT(texels[i]);
        for (int k = other < 0 ? 0 : firsts[other]; other >= 0 && k < firsts[other + 1]; ++k) {
            Reading reading;
            const float share = share_of(samples[k], i, atlas, numbers, resolution, states, &reading);
            if (share == 0.0f)
                continue;
            const float4 value = value_of(values, channels, k);
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

// A step: the light of fitted texels makes the display more alike the samples that read them. Others stay as they are.
__kernel void step_of_fit(__global const float4 *samples, __global const int *firsts, __global const uint *texels,
                          __global const uint *numbers, const int resolution, __global const uchar *states,
                          __global const float *values, const int channels, __global const float4 *low,
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
    AROUND {
        const int other = NUMBER_AT(texels[i]);
        for (int k = other < 0 ? 0 : firsts[other]; other >= 0 && k < firsts[other + 1]; ++k) {
            Reading reading;
            const float share = share_of(samples[k], i, atlas, numbers, resolution, states, &reading);
            if (share == 0.0f)
                continue;
            float4 off = value_of(values, channels, k);
            for (int corner = 0; corner < 4; ++corner)
                if (reading.number[corner] >= 0)
                    off -= reading.weight[corner] * light[reading.number[corner]];
            change += share * off;
        }
    }
    changed[i] = clamp(light[i] + steps[i] * change, low[i], high[i]);
}
