#include "bilinear_taps.cl"
#include "texel_links.cl"

// Builds the least-squares equations of texels whose bilinear interpolation reproduces irradiance at sample points, and
// is equal on both sides of seams (engine/postprocess/bilinear_equations.py).

// Flags of texels. TOLD: a sample point constrains the texel. UNKNOWN: the texel is an unknown of the equations. RIGHT,
// UPPER: a lookup reads the texel together with its right or upper neighbour.
#define TOLD 1u
#define UNKNOWN 2u
#define RIGHT 4u
#define UPPER 8u

#define SEAM_WEIGHT 30.0f
#define SMOOTHNESS 0.01f

// Diagonal entry from which on sample points alone determine a texel.
#define WELL_KNOWN 0.15f

// Minimum bilinear weight at which a point constrains a texel, or a texel takes part in a seam.
#define TELLS 1e-3f

#define CORNERS 8  // texels read by both sides of a seam

void mark_footprint(const Footprint *f, const int atlas, const int resolution, __global uint *marks)
{
    for (int corner = 0; corner < 4; ++corner) {
        const uint texel = flat_index(atlas, corner_of(f, corner), resolution);
        if (weight_of(f, corner) == 0.0f)
            continue;
        uint mark = UNKNOWN;
        mark |= !(corner & 1) && weight_of(f, corner | 1) > 0.0f ? RIGHT : 0u;
        mark |= !(corner & 2) && weight_of(f, corner | 2) > 0.0f ? UPPER : 0u;
        atomic_or(marks + texel, mark);
    }
}

// Stores 1 for each texel that is an unknown.
__kernel void unknown_texels(__global const uint *marks, __global uchar *unknown, const int count)
{
    const int texel = get_global_id(0);
    if (texel < count)
        unknown[texel] = (marks[texel] & UNKNOWN) != 0;
}

// Marks texels that sample points read.
__kernel void mark_points(__global const float2 *positions, __global const uint *owners, __global uint *marks,
                          const int resolution, const int count)
{
    const int point = get_global_id(0);
    if (point >= count)
        return;
    const int atlas = owners[point] / ((uint)resolution * resolution);
    const Footprint f = footprint_at(positions[point], resolution);
    mark_footprint(&f, atlas, resolution, marks);
    for (int corner = 0; corner < 4; ++corner)
        if (weight_of(&f, corner) > TELLS)
            atomic_or(marks + flat_index(atlas, corner_of(&f, corner), resolution), TOLD);
    atomic_or(marks + owners[point], TOLD);
}

// Returns true if a sample point constrains any texel that a look-up reads.
bool has_equation(const Footprint *f, const int atlas, const int resolution, __global const uchar *centres,
                  __global const uint *marks)
{
    for (int corner = 0; corner < 4; ++corner) {
        const uint texel = flat_index(atlas, corner_of(f, corner), resolution);
        if (weight_of(f, corner) > TELLS && (centres[texel] || marks[texel] & TOLD))
            return true;
    }
    return false;
}

// Marks texels that seams read. A seam counts if sample points constrain at least one of its sides.
__kernel void mark_seams(__global const float4 *sides, __global const int2 *atlases, __global const uchar *centres,
                         __global uint *marks, __global uchar *counts, const int resolution, const int count)
{
    const int seam = get_global_id(0);
    if (seam >= count)
        return;
    const int2 atlas = atlases[seam];
    const Footprint first = footprint_at(sides[seam].xy, resolution), second = footprint_at(sides[seam].zw, resolution);
    counts[seam] = has_equation(&first, atlas.x, resolution, centres, marks)
        || has_equation(&second, atlas.y, resolution, centres, marks);
    if (counts[seam]) {
        mark_footprint(&first, atlas.x, resolution, marks);
        mark_footprint(&second, atlas.y, resolution, marks);
    }
}

__kernel void number_texels(__global const uint *texels, __global int *numbers, const int count)
{
    const int unknown = get_global_id(0);
    if (unknown < count)
        numbers[texels[unknown]] = unknown;
}

// Stores the range of points of each unknown texel; points are sorted by texel. Start and end are separate int stores
// by different work items: storing an int2 would overwrite the other half.
__kernel void find_points(__global const uint *owners, __global const int *numbers, __global int *ranges,
                          const int count)
{
    const int point = get_global_id(0);
    if (point >= count)
        return;
    const uint texel = owners[point];
    if (point == 0 || owners[point - 1] != texel)
        ranges[2 * numbers[texel]] = point;
    if (point == count - 1 || owners[point + 1] != texel)
        ranges[2 * numbers[texel] + 1] = point + 1;
}

// Assembles the nine-point stencil of each unknown: indices of its neighbours (itself where none is unknown) and the
// coefficients from sample points.
__kernel void link_texels(__global const uint *texels, __global const int *numbers, __global const uint *marks,
                          __global const uchar *centres, __global const int2 *ranges, __global const float2 *positions,
                          __global const float *weights, __global int *neighbours, __global float *factors,
                          __global uint *linked, __global float *diagonal, const int resolution, const int count)
{
    const int unknown = get_global_id(0);
    if (unknown >= count)
        return;
    const uint texel = texels[unknown], row = texel / resolution;
    const int2 at = (int2)(texel % resolution, row % resolution);
    float sums[LINKS] = {0.0f};
    sums[4] = centres[texel] ? 1.0f : 0.0f;
    for (int link = 0; link < LINKS; ++link) {
        const int2 place = at + (int2)(link % 3 - 1, link / 3 - 1);
        const uint other = texel + (link / 3 - 1) * resolution + (link % 3 - 1);
        const bool there = all(place >= 0) && all(place < resolution) && marks[other] & UNKNOWN;
        const int number = there ? numbers[other] : unknown;
        neighbours[link * count + unknown] = number;
        if (!there)
            continue;
        for (int point = ranges[number].x; point < ranges[number].y; ++point) {
            const Footprint f = footprint_at(positions[point], resolution);
            float own = 0.0f;
            for (int corner = 0; corner < 4; ++corner)
                if (all(corner_of(&f, corner) == at))
                    own = fmax(own, weight_of(&f, corner));
            if (own == 0.0f)
                continue;
            for (int corner = 0; corner < 4; ++corner) {
                const int2 step = corner_of(&f, corner) - at + 1;
                sums[step.y * 3 + step.x] += weights[point] * own * weight_of(&f, corner);
            }
        }
    }
    uint marked = 0u;
    for (int link = 0; link < LINKS; ++link) {
        factors[link * count + unknown] = sums[link];
        marked |= sums[link] > 0.0f ? 1u << link : 0u;
    }
    linked[unknown] = marked;
    diagonal[unknown] = sums[4];
}

// Adds smoothness terms between neighbours if one of them is poorly constrained.
__kernel void smooth_links(__global const uint *texels, __global const uint *marks, __global const int *neighbours,
                           __global const float *diagonal, __global float *factors, __global uint *linked,
                           const int resolution, const int count)
{
    const int unknown = get_global_id(0);
    if (unknown >= count)
        return;
    const uint texel = texels[unknown];
    for (int link = 1; link < LINKS; link += 2) {
        const int other = neighbours[link * count + unknown];
        if (other == unknown)
            continue;
        // The flag of a pair is stored at its left or lower texel.
        const uint first = link < 4 ? texels[other] : texel;
        if (!(marks[first] & (link == 3 || link == 5 ? RIGHT : UPPER)))
            continue;
        const float weight = SMOOTHNESS * (1.0f - fmin(diagonal[unknown], diagonal[other]) / WELL_KNOWN);
        if (weight > 0.0f) {
            factors[link * count + unknown] -= weight;
            factors[4 * count + unknown] += weight;
            linked[unknown] |= SMOOTH << link;
        }
    }
}

// Assembles the rows of seams: unknowns and coefficients of both sides; all 0 for seams that do not count. Slots
// without weight repeat an unknown that has weight.
__kernel void seam_rows(__global const float4 *sides, __global const int2 *atlases, __global const float *lengths,
                        __global const uchar *counts, __global const int *numbers, __global int8 *columns,
                        __global float8 *entries, __global int *uses, const int resolution, const int count)
{
    const int seam = get_global_id(0);
    if (seam >= count)
        return;
    int column[CORNERS] = {0};
    float entry[CORNERS] = {0.0f};
    if (counts[seam]) {
        const float root = sqrt(SEAM_WEIGHT * lengths[seam]);
        int some = -1;
        for (int side = 0; side < 2; ++side) {
            const Footprint f = footprint_at(side ? sides[seam].zw : sides[seam].xy, resolution);
            for (int corner = 0; corner < 4; ++corner) {
                const int k = 4 * side + corner;
                const float weight = weight_of(&f, corner);
                entry[k] = (side ? -root : root) * weight;
                column[k] = -1;
                if (weight > 0.0f) {
                    const int atlas = side ? atlases[seam].y : atlases[seam].x;
                    column[k] = numbers[flat_index(atlas, corner_of(&f, corner), resolution)];
                    some = column[k];
                    atomic_inc(uses + column[k]);
                }
            }
        }
        for (int k = 0; k < CORNERS; ++k)
            column[k] = column[k] < 0 ? some : column[k];
    }
    columns[seam] = vload8(0, column);
    entries[seam] = vload8(0, entry);
}

// Lists the seam entries (seam * 8 + corner) of each unknown from next[unknown] on, in arbitrary order.
__kernel void list_entries(__global const int *columns, __global const float *entries, __global int *next,
                           __global int *list, const int count)
{
    const int entry = get_global_id(0);
    if (entry < count && entries[entry] != 0.0f)
        list[atomic_inc(next + columns[entry])] = entry;
}

// Sorts the entries of each unknown, so that sums are the same in every bake. Splits them into seam and coefficient,
// and adds squared coefficients to the diagonal. inverse: reciprocal diagonal (Jacobi preconditioner).
__kernel void order_entries(__global const int *starts, __global const float *entries, __global const float *factors,
                            __global int *list, __global float *shares, __global float *inverse, const int count)
{
    const int unknown = get_global_id(0);
    if (unknown >= count)
        return;
    const int first = starts[unknown], last = starts[unknown + 1];
    for (int i = first + 1; i < last; ++i) {
        const int entry = list[i];
        int k = i;
        for (; k > first && list[k - 1] > entry; --k)
            list[k] = list[k - 1];
        list[k] = entry;
    }
    float sum = factors[4 * count + unknown];
    for (int i = first; i < last; ++i) {
        shares[i] = entries[list[i]];
        sum += shares[i] * shares[i];
        list[i] /= CORNERS;
    }
    inverse[unknown] = 1.0f / sum;
}
