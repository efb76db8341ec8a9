#include "bilinear_taps.cl"
#include "texel_links.cl"

// Solves texels of several outputs by conjugate gradients with bounds (engine/postprocess/bounded_cg.py). Irradiance is
// scaled to at most 1. All channels run in parallel with separate step sizes. Work items are unknowns, or seams, in
// dimension 0 and images in dimension 1; vectors have one plane per image.

#define IMAGE ((size_t)get_global_id(1))

#define OVERSHOOT 0.02f  // extension of bounds, as a fraction of the range
#define TOLERANCE 5e-3f  // residual at which a run ends, relative to its first

// Scalars of a run, stored in `run` for each image: the preconditioned residual norm of even and of odd steps, and the
// norm at which the run ends.
#define ENOUGH 2
#define NUMBERS 3

#define EQUATIONS \
    __global const int *neighbours, __global const float *factors, __global const uint *linked, \
        __global const int *starts, __global const int *seams, __global const float *shares

#define BOTH_SIDES 8

// Accumulates the sample points around each unknown: right-hand side, weighted mean, and range of the points in its own
// texel. reached: 1 if a mean exists. scales: maximum and its reciprocal for each image.
__kernel void sum_points(__global const uint *texels, __global const uchar *centres, __global const float4 *image,
                         __global const int *neighbours, __global const int2 *ranges, __global const float2 *positions,
                         __global const float *weights, __global const float4 *light, __global const float2 *scales,
                         __global float4 *right, __global float4 *mean, __global uchar *reached, __global float4 *low,
                         __global float4 *high, const int resolution, const uint size, const int points,
                         const int count)
{
    const int unknown = get_global_id(0);
    if (unknown >= count)
        return;
    const uint texel = texels[unknown], row = texel / resolution;
    const size_t here = IMAGE * count + unknown;
    const float scale = scales[IMAGE].y;
    image += IMAGE * size;
    light += IMAGE * points;
    const int2 at = (int2)(texel % resolution, row % resolution);
    float4 sum = (float4)(0.0f), least = (float4)(INFINITY), most = (float4)(-INFINITY);
    float weight = 0.0f;
    if (centres[texel]) {
        sum = least = most = scale * image[texel];
        weight = 1.0f;
    }
    for (int link = 0; link < LINKS; ++link) {
        const int other = neighbours[link * count + unknown];
        if (other == unknown && link != 4)
            continue;
        for (int point = ranges[other].x; point < ranges[other].y; ++point) {
            const float4 value = scale * light[point];
            if (link == 4) {
                least = fmin(least, value);
                most = fmax(most, value);
            }
            const Footprint f = footprint_at(positions[point], resolution);
            for (int corner = 0; corner < 4; ++corner) {
                if (all(corner_of(&f, corner) == at)) {
                    sum += weights[point] * weight_of(&f, corner) * value;
                    weight += weights[point] * weight_of(&f, corner);
                }
            }
        }
    }
    right[here] = sum;
    mean[here] = weight > 0.0f ? sum / weight : (float4)(0.0f);
    reached[here] = weight > 0.0f;
    low[here] = least;
    high[here] = most;
}

// Initialises unknowns without points by the mean of neighbours linked by smoothness, in rounds.
__kernel void spread_along_links(__global const int *neighbours, __global const uint *linked, const uchar round,
                                 __global uchar *reached, __global float4 *solution, const int count)
{
    const int unknown = get_global_id(0);
    if (unknown >= count)
        return;
    reached += IMAGE * count;
    solution += IMAGE * count;
    if (reached[unknown])
        return;
    float4 sum = (float4)(0.0f);
    float total = 0.0f;
    for (int link = 1; link < LINKS; link += 2) {
        const int other = neighbours[link * count + unknown];
        const uchar when = reached[other];
        if (linked[unknown] & (SMOOTH << link) && when && when < round) {
            sum += solution[other];
            total += 1.0f;
        }
    }
    if (total > 0.0f) {
        solution[unknown] = sum / total;
        reached[unknown] = round;
    }
}

// Initialises, along seams, unknowns that no sample point reaches: each gets the mean of the initialised unknowns in
// its seam rows.
__kernel void spread_along_seams(__global const int *starts, __global const int *seams, __global const int *columns,
                                 const uchar round, __global uchar *reached, __global float4 *solution, const int count)
{
    const int unknown = get_global_id(0);
    if (unknown >= count)
        return;
    reached += IMAGE * count;
    solution += IMAGE * count;
    if (reached[unknown])
        return;
    float4 sum = (float4)(0.0f);
    float total = 0.0f;
    for (int i = starts[unknown]; i < starts[unknown + 1]; ++i) {
        __global const int *row = columns + seams[i] * BOTH_SIDES;
        for (int k = 0; k < BOTH_SIDES; ++k) {
            const uchar when = reached[row[k]];
            if (when && when < round) {
                sum += solution[row[k]];
                total += 1.0f;
            }
        }
    }
    if (total > 0.0f) {
        solution[unknown] = sum / total;
        reached[unknown] = round;
    }
}

// Widens the range of each unknown to the ranges of unknowns that the same lookups read.
__kernel void widen_ranges(__global const int *neighbours, __global const uint *linked, __global const float4 *low,
                           __global const float4 *high, __global float4 *wide_low, __global float4 *wide_high,
                           const int count)
{
    const int unknown = get_global_id(0);
    if (unknown >= count)
        return;
    const size_t plane = IMAGE * count;
    float4 least = low[plane + unknown], most = high[plane + unknown];
    for (int link = 0; link < LINKS; ++link) {
        if (linked[unknown] & (1u << link)) {
            const size_t other = plane + neighbours[link * count + unknown];
            least = fmin(least, low[other]);
            most = fmax(most, high[other]);
        }
    }
    wide_low[plane + unknown] = least;
    wide_high[plane + unknown] = most;
}

// Stores the joint range of all unknowns that each seam reads.
__kernel void ranges_of_seams(__global const int *columns, __global const float4 *low, __global const float4 *high,
                              __global float4 *seam_low, __global float4 *seam_high, const int unknowns,
                              const int count)
{
    const int seam = get_global_id(0);
    if (seam >= count)
        return;
    float4 least = (float4)(INFINITY), most = (float4)(-INFINITY);
    for (int k = 0; k < BOTH_SIDES; ++k) {
        const size_t column = IMAGE * unknowns + columns[seam * BOTH_SIDES + k];
        least = fmin(least, low[column]);
        most = fmax(most, high[column]);
    }
    seam_low[IMAGE * count + seam] = least;
    seam_high[IMAGE * count + seam] = most;
}

// Computes the bounds of each unknown: joint range of its seams plus OVERSHOOT, within the range of all points. tight:
// the upper bound is the maximum of its own points where they exist.
__kernel void bound(__global const int *starts, __global const int *seams, __global const float4 *seam_low,
                    __global const float4 *seam_high, __global const float4 *all_points,
                    __global const float4 *own_high, const int tight, __global float4 *low, __global float4 *high,
                    const int rows, const int count)
{
    const int unknown = get_global_id(0);
    if (unknown >= count)
        return;
    const size_t here = IMAGE * count + unknown;
    float4 least = low[here], most = high[here];
    for (int i = starts[unknown]; i < starts[unknown + 1]; ++i) {
        least = fmin(least, seam_low[IMAGE * rows + seams[i]]);
        most = fmax(most, seam_high[IMAGE * rows + seams[i]]);
    }
    if (tight && isfinite(own_high[here].x))
        most = own_high[here];
    const float4 slack = OVERSHOOT * (most - least);
    low[here] = fmax(least - slack, all_points[2 * IMAGE]);
    high[here] = fmin(most + slack, all_points[2 * IMAGE + 1]);
}

// Stores the minimum and maximum of all ranges of an image. One work group per image.
__kernel void range_of_all(__global const float4 *low, __global const float4 *high, __global float4 *all_points,
                           const int count, __local float4 *partial)
{
    const int item = get_local_id(0), items = get_local_size(0);
    float4 least = (float4)(INFINITY), most = (float4)(-INFINITY);
    for (int i = item; i < count; i += items) {
        least = fmin(least, low[IMAGE * count + i]);
        most = fmax(most, high[IMAGE * count + i]);
    }
    partial[item] = least;
    partial[items + item] = most;
    for (int step = items / 2; step > 0; step /= 2) {
        barrier(CLK_LOCAL_MEM_FENCE);
        if (item < step) {
            partial[item] = fmin(partial[item], partial[item + step]);
            partial[items + item] = fmax(partial[items + item], partial[items + item + step]);
        }
    }
    if (item == 0) {
        all_points[2 * IMAGE] = partial[0];
        all_points[2 * IMAGE + 1] = partial[items];
    }
}

// Returns the difference between both sides of a seam from the eight values that it reads.
float4 difference_of(const float8 e, const float4 *v)
{
    return e.s0 * v[0] + e.s1 * v[1] + e.s2 * v[2] + e.s3 * v[3] + e.s4 * v[4] + e.s5 * v[5] + e.s6 * v[6]
        + e.s7 * v[7];
}

// Returns the difference between both sides of a seam. columns: the eight unknowns that it reads.
float4 difference_at(__global const int *columns, const float8 e, __global const float4 *values)
{
    float4 v[BOTH_SIDES];
    for (int k = 0; k < BOTH_SIDES; ++k)
        v[k] = values[columns[k]];
    return difference_of(e, v);
}

// Stores the difference between both sides of each seam.
__kernel void differences(__global const int *columns, __global const float8 *entries, __global const float4 *values,
                          __global float4 *products, const int unknowns, const int count)
{
    const int seam = get_global_id(0);
    if (seam < count)
        products[IMAGE * count + seam] =
            difference_at(columns + seam * BOTH_SIDES, entries[seam], values + IMAGE * unknowns);
}

// Returns a row of the normal equations times a vector. products: seam differences of that vector.
float4 row_times(EQUATIONS, __global const float4 *values, __global const float4 *products, const int unknown,
                 const int count)
{
    float4 sum = factors[4 * count + unknown] * values[unknown];
    const uint marks = linked[unknown];
    for (int link = 0; link < LINKS; ++link)
        if (link != 4 && marks & (1u << link | SMOOTH << link))
            sum += factors[link * count + unknown] * values[neighbours[link * count + unknown]];
    for (int i = starts[unknown]; i < starts[unknown + 1]; ++i)
        sum += shares[i] * products[seams[i]];
    return sum;
}

// Returns 0 for channels held at a bound, else 1.
float4 free_channels(const uchar held)
{
    return (float4)(held & 1 ? 0.0f : 1.0f, held & 2 ? 0.0f : 1.0f, held & 4 ? 0.0f : 1.0f, 0.0f);
}

// Sums values over the work group; the sum is partial[0] of item 0.
void sum_group(const float4 value, __local float4 *partial)
{
    const int item = get_local_id(0);
    partial[item] = value;
    for (int step = get_local_size(0) / 2; step > 0; step /= 2) {
        barrier(CLK_LOCAL_MEM_FENCE);
        if (item < step)
            partial[item] += partial[item + step];
    }
}

// Sums values over the work group and stores the partial sum of an image.
void add_group(const float4 value, __local float4 *partial, __global float4 *sums)
{
    sum_group(value, partial);
    if (get_local_id(0) == 0)
        sums[IMAGE * get_num_groups(0) + get_group_id(0)] = partial[0];
}

// Returns the sum of the partial sums of all groups of a launch, in the same order in every group.
float4 total_of(__global const float4 *sums, const int groups, __local float4 *partial)
{
    float4 sum = (float4)(0.0f);
    for (int i = get_local_id(0); i < groups; i += get_local_size(0))
        sum += sums[IMAGE * groups + i];
    sum_group(sum, partial);
    barrier(CLK_LOCAL_MEM_FENCE);
    const float4 total = partial[0];
    barrier(CLK_LOCAL_MEM_FENCE);
    return total;
}

// Starts conjugate gradients: residual, first search direction, and partial sums of the preconditioned residual norm.
// Like the other kernels with partial sums, it runs in few groups, which take the unknowns in turn.
__kernel void begin_run(EQUATIONS, __global const float *inverse, __global const float4 *right,
                        __global const uchar *held, __global const float4 *solution, __global const float4 *products,
                        __global float4 *residual, __global float4 *direction, __global float4 *sums, const int rows,
                        const int count, __local float4 *partial)
{
    const size_t plane = IMAGE * count;
    float4 energy = (float4)(0.0f);
    for (int unknown = get_global_id(0); unknown < count; unknown += get_global_size(0)) {
        const size_t here = plane + unknown;
        const float4 product = row_times(neighbours, factors, linked, starts, seams, shares, solution + plane,
                                         products + IMAGE * rows, unknown, count);
        const float4 r = free_channels(held[here]) * (right[here] - product);
        residual[here] = r;
        direction[here] = inverse[unknown] * r;
        energy += inverse[unknown] * r * r;
    }
    add_group(energy, partial, sums);
}

// Stores the residual norm before the first step, and with `first` the norm at which the run ends. One group per image.
__kernel void begin_steps(__global const float4 *sums, const int groups, const int first, __global float4 *run,
                          __local float4 *partial)
{
    const float4 energy = total_of(sums, groups, partial);
    if (get_local_id(0) > 0)
        return;
    run[NUMBERS * IMAGE] = energy;
    if (first)
        run[NUMBERS * IMAGE + ENOUGH] = TOLERANCE * TOLERANCE * energy;
}

// Multiplies the matrix by the search direction, and stores partial sums of its curvature.
__kernel void cg_curvature(EQUATIONS, __global const uchar *held, __global const float4 *direction,
                           __global const float4 *products, __global float4 *change, __global float4 *sums,
                           const int rows, const int count, __local float4 *partial)
{
    const size_t plane = IMAGE * count;
    float4 curvature = (float4)(0.0f);
    for (int unknown = get_global_id(0); unknown < count; unknown += get_global_size(0)) {
        const size_t here = plane + unknown;
        const float4 q = free_channels(held[here])
            * row_times(neighbours, factors, linked, starts, seams, shares, direction + plane, products + IMAGE * rows,
                        unknown, count);
        change[here] = q;
        curvature += q * direction[here];
    }
    add_group(curvature, partial, sums);
}

// Takes a step along the search direction and updates the residual; stores partial sums of its norm. Channels below the
// threshold get steps of 0. curvatures: partial sums of cg_curvature, one for each group of this launch; odd: 1 in odd
// steps.
__kernel void advance(__global const float *inverse, __global const float4 *direction, __global const float4 *change,
                      __global const float4 *curvatures, __global const float4 *run, const int odd,
                      __global float4 *solution, __global float4 *residual, __global float4 *sums, const int count,
                      __local float4 *partial)
{
    const float4 curvature = total_of(curvatures, get_num_groups(0), partial), before = run[NUMBERS * IMAGE + odd];
    const int4 busy = before > run[NUMBERS * IMAGE + ENOUGH];
    const float4 step = busy && curvature > 0.0f ? before / curvature : (float4)(0.0f);
    float4 energy = (float4)(0.0f);
    for (int unknown = get_global_id(0); unknown < count; unknown += get_global_size(0)) {
        const size_t here = IMAGE * count + unknown;
        solution[here] += step * direction[here];
        const float4 r = residual[here] - step * change[here];
        residual[here] = r;
        energy += inverse[unknown] * r * r;
    }
    add_group(energy, partial, sums);
}

// Returns the next search direction of an unknown.
float4 next_of(const float inverse, const float4 residual, const float4 ratio, const float4 direction)
{
    return inverse * residual + ratio * direction;
}

// Computes the next search direction and its difference between both sides of each seam, and stores the residual norm
// for the next step. energies: partial sums of `advance`, one for each group of this launch; odd: 1 in odd steps.
__kernel void cg_direction(__global const int *columns, __global const float8 *entries, __global const float *inverse,
                           __global const float4 *residual, __global const float4 *energies, __global float4 *run,
                           const int odd, __global const float4 *direction, __global float4 *following,
                           __global float4 *products, const int rows, const int count, __local float4 *partial)
{
    const float4 energy = total_of(energies, get_num_groups(0), partial);
    run += NUMBERS * IMAGE;
    const float4 before = run[odd];
    const int4 busy = before > run[ENOUGH];
    const float4 ratio = busy ? energy / before : (float4)(0.0f);
    if (get_global_id(0) == 0)
        run[1 - odd] = energy;
    residual += IMAGE * count, direction += IMAGE * count;
    for (int unknown = get_global_id(0); unknown < count; unknown += get_global_size(0))
        following[IMAGE * count + unknown] =
            next_of(inverse[unknown], residual[unknown], ratio, direction[unknown]);
    for (int seam = get_global_id(0); seam < rows; seam += get_global_size(0)) {
        float4 v[BOTH_SIDES];
        for (int k = 0; k < BOTH_SIDES; ++k) {
            const int column = columns[seam * BOTH_SIDES + k];
            v[k] = next_of(inverse[column], residual[column], ratio, direction[column]);
        }
        products[IMAGE * rows + seam] = difference_of(entries[seam], v);
    }
}

// Runs all iterations of a small system in one work group per image: begin_run, differences, cg_curvature, advance and
// cg_direction. totals: partial sums of each chunk of a group's size; `width`,
// a power of two, is at least the number of chunks. Ends when all channels are below the threshold.
__kernel void descend(EQUATIONS, __global const int *columns, __global const float8 *entries,
                      __global const float *inverse, __global const float4 *right, __global const uchar *held,
                      __global float4 *solution, __global float4 *products, __global float4 *residual,
                      __global float4 *direction, __global float4 *change, __global float4 *run, const int first,
                      const int steps, const int rows, const int count, __local float4 *partial, __local float4 *totals,
                      const int width)
{
    const int item = get_local_id(0), items = get_local_size(0);
    right += IMAGE * count, held += IMAGE * count, solution += IMAGE * count, residual += IMAGE * count;
    direction += IMAGE * count, change += IMAGE * count, products += IMAGE * rows, run += NUMBERS * IMAGE;
    float4 enough = run[ENOUGH], energy = (float4)(0.0f), step = energy, ratio = energy;

    // Phase 0 starts the run; then each iteration has a phase for the curvature and one for the step.
    for (int phase = 0; phase <= 2 * steps; ++phase) {
        const bool starts_run = phase == 0, is_curvature = phase % 2;
        if (is_curvature && !any(energy > enough))
            break;
        if (starts_run || is_curvature) {
            __global const float4 *values = starts_run ? solution : direction;
            for (int seam = item; seam < rows; seam += items)
                products[seam] = difference_at(columns + seam * BOTH_SIDES, entries[seam], values);
            barrier(CLK_GLOBAL_MEM_FENCE);
        }
        for (int chunk = 0; chunk * items < count; ++chunk) {
            const int unknown = chunk * items + item;
            float4 part = (float4)(0.0f);
            if (unknown < count && starts_run) {
                const float4 product =
                    row_times(neighbours, factors, linked, starts, seams, shares, solution, products, unknown, count);
                const float4 r = free_channels(held[unknown]) * (right[unknown] - product);
                residual[unknown] = r;
                direction[unknown] = inverse[unknown] * r;
                part = inverse[unknown] * r * r;
            } else if (unknown < count && is_curvature) {
                const float4 q = free_channels(held[unknown])
                    * row_times(neighbours, factors, linked, starts, seams, shares, direction, products, unknown,
                                count);
                change[unknown] = q;
                part = q * direction[unknown];
            } else if (unknown < count) {
                solution[unknown] += step * direction[unknown];
                const float4 r = residual[unknown] - step * change[unknown];
                residual[unknown] = r;
                part = inverse[unknown] * r * r;
            }
            sum_group(part, partial);
            if (item == 0)
                totals[chunk] = partial[0];
            barrier(CLK_LOCAL_MEM_FENCE);
        }
        for (int i = (count + items - 1) / items + item; i < width; i += items)
            totals[i] = (float4)(0.0f);
        for (int half_width = width / 2; half_width > 0; half_width /= 2) {
            barrier(CLK_LOCAL_MEM_FENCE);
            for (int i = item; i < half_width; i += items)
                totals[i] += totals[i + half_width];
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        const float4 sum = totals[0];
        const int4 busy = energy > enough;
        if (is_curvature) {
            step = busy && sum > 0.0f ? energy / sum : (float4)(0.0f);
        } else {
            if (starts_run && first)
                enough = TOLERANCE * TOLERANCE * sum;
            ratio = busy ? sum / energy : (float4)(0.0f);
            energy = sum;
            for (int unknown = item; !starts_run && unknown < count; unknown += items)
                direction[unknown] = next_of(inverse[unknown], residual[unknown], ratio, direction[unknown]);
        }
        barrier(CLK_GLOBAL_MEM_FENCE | CLK_LOCAL_MEM_FENCE);
    }
    if (item == 0)
        run[ENOUGH] = enough;
}

// Clamps unknowns to their bounds, and marks the clamped channels as held.
__kernel void clamp_bounds(__global const float4 *low, __global const float4 *high, __global float4 *solution,
                           __global uchar *held, const int count)
{
    const int unknown = get_global_id(0);
    if (unknown >= count)
        return;
    const size_t here = IMAGE * count + unknown;
    const float4 before = solution[here], within = fmin(fmax(before, low[here]), high[here]);
    const int4 outside = before != within;
    solution[here] = within;
    held[here] = (outside.x ? 1 : 0) | (outside.y ? 2 : 0) | (outside.z ? 4 : 0);
}

__kernel void keep_texels(__global const uint *texels, __global const float4 *solution, __global const float2 *scales,
                          __global float4 *image, const uint size, const int count)
{
    const int unknown = get_global_id(0);
    if (unknown < count)
        image[IMAGE * size + texels[unknown]] = scales[IMAGE].x * solution[IMAGE * count + unknown];
}
