// Finds overlapping pairs of chart-edge boxes by hierarchical grid hashing: one grid of cubes per box size. Each box is
// entered at its own size and queried at all larger sizes (engine/patches/edge_boxes.py).

#define AXES 6  // three of position, then three of the normal

// Returns the integer coordinate of a hash grid cube along one axis.
long cube_at(const float place, const float inverse) { return (long)floor(place * inverse); }

// Returns the index of the first of ascending keys that is at least `key`.
int lower_bound(__global const long *keys, const int count, const long key)
{
    int first = 0, last = count;
    while (first < last) {
        const int middle = first + (last - first) / 2;
        if (keys[middle] < key)
            first = middle + 1;
        else
            last = middle;
    }
    return first;
}

// Lists pairs of overlapping boxes. Work item `start` + i is one box and one size (item / count) of its partner.
// boxes: 6 low, then 6 high bounds each. inverses: 1 / cube size, powers of two, so that products are exact.
// ranks: size class of each box. keys, owners: cubes of all boxes, ascending, and the box in each.
// listed: number of pairs found, which may exceed the capacity `most`.
__kernel void find_edge_neighbours(__global const float *boxes, __global const int *ranks,
                                   __global const float *inverses, __global const long *keys,
                                   __global const int *owners, const int entries, const long4 factors, const int count,
                                   const long start, const long end, __global int2 *pairs, __global uint *listed,
                                   const uint most)
{
    const long item = start + get_global_id(0);
    if (item >= end)
        return;
    const int box = item % count, rank = item / count;
    if (ranks[box] > rank)
        return;
    float low[AXES], high[AXES];
    for (int axis = 0; axis < AXES; ++axis) {
        low[axis] = boxes[2 * AXES * box + axis];
        high[axis] = boxes[2 * AXES * box + AXES + axis];
    }
    const float inverse = inverses[rank];
    long first[3], last[3];
    for (int axis = 0; axis < 3; ++axis) {
        first[axis] = cube_at(low[axis], inverse);
        last[axis] = cube_at(high[axis], inverse);
    }

    // Hash the cubes that the box covers: one or two along each axis.
    for (int corner = 0; corner < 8; ++corner) {
        long cube[3], key = rank * factors.w;
        bool repeated = false;
        for (int axis = 0; axis < 3; ++axis) {
            const bool second = corner >> axis & 1;
            repeated |= second && first[axis] == last[axis];
            cube[axis] = second ? last[axis] : first[axis];
        }
        if (repeated)
            continue;
        key += cube[0] * factors.x + cube[1] * factors.y + cube[2] * factors.z;
        for (int entry = lower_bound(keys, entries, key); entry < entries && keys[entry] == key; ++entry) {
            const int other = owners[entry];
            bool found = ranks[other] == rank && (ranks[box] < rank || box < other);
            for (int axis = 0; axis < AXES && found; ++axis)
                found =
                    low[axis] <= boxes[2 * AXES * other + AXES + axis] && boxes[2 * AXES * other + axis] <= high[axis];

            // Report a pair only in the lowest cube that both boxes share.
            for (int axis = 0; axis < 3 && found; ++axis) {
                const long start = cube_at(boxes[2 * AXES * other + axis], inverse);
                found = cube[axis] == (first[axis] > start ? first[axis] : start);
            }
            if (!found)
                continue;
            const uint place = atomic_inc(listed);
            if (place >= most)
                return;
            pairs[place] = (int2)(box, other);
        }
    }
}
