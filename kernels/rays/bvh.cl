#pragma once

// Bottom-up BVH construction by PLOC (parallel locally-ordered clustering; Meister and Bittner 2018): triangles are
// sorted along a Morton curve, and neighbouring clusters merge where each is the other's best partner. A few remaining
// clusters are joined from the top down (bvh_upper_levels.cl). Binary nodes then collapse to nodes of WIDTH children
// whose leaves hold packets of PACKET triangles. engine/visibility/rays/bvh.py runs these kernels; bvh_traversal.cl
// reads the result.

#define FAR 8
#define CHUNK 32  // values that one work item sums
#define LEAF_BITS 3

typedef struct {
    float3 low, high;
} Box;

float half_area(const float3 size) { return size.x * size.y + size.y * size.z + size.z * size.x; }

// Returns one corner of a triangle, world space. positions: 3 x 3 floats per triangle.
float3 corner_of(__global const float *positions, const int triangle, const int corner)
{
    return vload3(3 * triangle + corner, positions);
}

Box box_of(__global const float *positions, const int triangle)
{
    const float3 a = corner_of(positions, triangle, 0);
    const float3 b = corner_of(positions, triangle, 1);
    const float3 c = corner_of(positions, triangle, 2);
    const Box box = {min(a, min(b, c)), max(a, max(b, c))};
    return box;
}

// Inserts two zero bits before each of the lowest 21 bits of x, so that three such values interleave to a Morton code.
ulong spread(ulong x)
{
    x = (x | x << 32) & 0x1f00000000ffff;
    x = (x | x << 16) & 0x1f0000ff0000ff;
    x = (x | x << 8) & 0x100f00f00f00f00f;
    x = (x | x << 4) & 0x10c30c30c30c30c3;
    return (x | x << 2) & 0x1249249249249249;
}

// Stores the sort key of each triangle: the Morton code of its box centre, above the triangle's index in the lowest
// `number_bits` bits. The scene spans -1/scale to 1/scale on each axis.
__kernel void morton_keys(__global const float *positions, const float scale, const int number_bits,
                          __global ulong *keys, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const int axis_bits = min((63 - number_bits) / 3, 21);
    const Box box = box_of(positions, i);
    const float cells = (float)(1 << axis_bits);
    const float3 at = ((box.low + box.high) * (0.5f * scale) + 1.0f) * (0.5f * cells);
    const uint3 cell = convert_uint3(clamp(at, 0.0f, cells - 1.0f));
    const ulong code = spread(cell.x) << 2 | spread(cell.y) << 1 | spread(cell.z);
    keys[i] = code << number_bits | (ulong)i;
}

// Clusters are stored as six rows of floats (low x, y, z, high x, y, z) with FAR padding entries at both ends. The
// array `cluster` holds the binary node of each cluster.
void store_box(__global float *rows, const int stride, const int i, const Box box)
{
    __global float *at = rows + FAR + i;
    at[0] = box.low.x, at[stride] = box.low.y, at[2 * stride] = box.low.z;
    at[3 * stride] = box.high.x, at[4 * stride] = box.high.y, at[5 * stride] = box.high.z;
}

Box load_box(__global const float *rows, const int stride, const int i)
{
    __global const float *at = rows + FAR + i;
    const Box box = {(float3)(at[0], at[stride], at[2 * stride]),
                     (float3)(at[3 * stride], at[4 * stride], at[5 * stride])};
    return box;
}

// Stores an infinite box as padding beyond the ends of the rows. No cluster ever chooses it as a partner.
void store_end(__global float *rows, const int stride, const int i)
{
    const Box endless = {(float3)(-INFINITY), (float3)(INFINITY)};
    store_box(rows, stride, i, endless);
}

// Stores a binary node: its box, its cost by the surface area heuristic, and a link with two children, triangle count
// and leaf flag. The node of a single triangle has the triangle's index as its left child and -1 as its right.
void store_node(__global NodeBox *boxes, __global NodeLink *links, const int node, const Box box, const float cost,
                const NodeLink link)
{
    vstore3(box.low, 0, boxes[node].low);
    vstore3(box.high, 0, boxes[node].high);
    boxes[node].cost = cost;
    links[node] = link;
}

float area_of(__global const NodeBox *boxes, const int node)
{
    return half_area(vload3(0, boxes[node].high) - vload3(0, boxes[node].low));
}

// Makes the parent of two binary nodes. The parent becomes a leaf if it has at most LEAF triangles and testing them all
// costs no more than testing the children's boxes (surface area heuristic).
void join_nodes(__global NodeBox *boxes, __global NodeLink *links, const int node, const int left, const int right)
{
    const Box box = {min(vload3(0, boxes[left].low), vload3(0, boxes[right].low)),
                     max(vload3(0, boxes[left].high), vload3(0, boxes[right].high))};
    const int size = links[left].triangles + links[right].triangles;
    const float area = half_area(box.high - box.low);
    const float parted = area + boxes[left].cost + boxes[right].cost;
    const float whole = area * (PACKET_COST * ((size + PACKET - 1) / PACKET));
    const bool leaf = size <= LEAF && !(parted < whole);
    const NodeLink link = {left, right, size, leaf};
    store_node(boxes, links, node, box, leaf ? whole : parted, link);
}

// Makes one cluster and one leaf node per triangle, in Morton order.
__kernel void single_clusters(__global const float *positions, __global const ulong *keys, const ulong number_mask,
                              __global float *rows, const int stride, __global int *cluster, __global NodeBox *boxes,
                              __global NodeLink *links, const int count)
{
    const int i = (int)get_global_id(0) - FAR;
    if (i >= count + FAR)
        return;
    if (i < 0 || i >= count) {
        store_end(rows, stride, i);
        return;
    }
    const int number = (int)(keys[i] & number_mask);
    const Box box = box_of(positions, number);
    store_box(rows, stride, i, box);
    cluster[i] = i;
    const NodeLink link = {number, -1, 1, 1};
    store_node(boxes, links, i, box, half_area(box.high - box.low) * PACKET_COST, link);
}

// Finds the best partner of each cluster among the FAR clusters on either side: the one with the smallest surface area
// of the joint box. Among equal areas the cluster's own pair (index ^ 1) wins, so that equal boxes merge in pairs.
__kernel void best_neighbours(__global const float *rows, const int stride, __global int *best, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    __global const float *at = rows + FAR + i;
    const Box own = load_box(rows, stride, i);
    float8 least = INFINITY;
    int8 which = 0;
    const int8 lanes = (int8)(0, 1, 2, 3, 4, 5, 6, 7);
    for (int near = 0; near < FAR; near += 8)
        for (int side = 0; side < 2; ++side) {
            const int first = side ? 1 + near : -8 - near;
            __global const float *low = at + first, *high = low + 3 * stride;
            const float8 x = max(vload8(0, high), own.high.x) - min(vload8(0, low), own.low.x);
            const float8 y = max(vload8(0, high + stride), own.high.y) - min(vload8(0, low + stride), own.low.y);
            const float8 z =
                max(vload8(0, high + 2 * stride), own.high.z) - min(vload8(0, low + 2 * stride), own.low.z);
            const float8 area = x * y + y * z + z * x;
            const int8 less = area < least;
            least = select(least, area, less);
            which = select(which, first + lanes, less);
        }
    const int partner = (i ^ 1) - i, lane = partner > 0 ? 0 : 7;
    float areas[8];
    int others[8];
    vstore8(least, 0, areas);
    vstore8(which, 0, others);
    float area = areas[lane];
    int other = others[lane];
    for (int k = 0; k < 8; ++k)
        if (areas[k] < area) {
            area = areas[k];
            other = others[k];
        }
    best[i] = i + other;
}

// Returns the cluster with which cluster i merges, or i itself unless both chose each other. paired: merge i with i ^ 1
// regardless of `best`, used when mutual choices become rare.
int mutual_best(__global const int *best, const int i, const int paired, const int count)
{
    if (paired)
        return min(i ^ 1, count - 1);
    const int other = best[i];
    return best[other] == i ? other : i;
}

// Counts, for each cluster, the survivors (x) and new nodes (y) before it within its chunk of CHUNK clusters. totals:
// both sums of each chunk. First pass of a prefix sum.
__kernel void count_merges(__global const int *best, const int paired, __global int2 *before, __global int2 *totals,
                           const int count)
{
    const int first = CHUNK * get_global_id(0), last = min(first + CHUNK, count);
    if (first >= count)
        return;
    int2 sum = 0;
    for (int i = first; i < last; ++i) {
        const int mate = mutual_best(best, i, paired, count);
        before[i] = sum;
        sum += (int2)(mate >= i, mate > i);
    }
    totals[get_global_id(0)] = sum;
}

// Replaces values by their exclusive prefix sums within each chunk. totals: the sum of each chunk.
__kernel void sum_chunks(__global int2 *values, __global int2 *totals, const int count)
{
    const int first = CHUNK * get_global_id(0), last = min(first + CHUNK, count);
    if (first >= count)
        return;
    int2 sum = 0;
    for (int i = first; i < last; ++i) {
        const int2 value = values[i];
        values[i] = sum;
        sum += value;
    }
    totals[get_global_id(0)] = sum;
}

// Replaces the totals of chunks by their exclusive prefix sums and appends the grand total. Runs as one work group.
__kernel void sum_totals(__global int2 *totals, const int count, __local int2 *sums)
{
    const int item = get_local_id(0), items = get_local_size(0), each = (count + items - 1) / items;
    const int first = min(item * each, count), last = min(first + each, count);
    int2 sum = 0;
    for (int i = first; i < last; ++i)
        sum += totals[i];
    sums[item] = sum;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item == 0) {
        int2 before = 0;
        for (int i = 0; i < items; ++i) {
            const int2 value = sums[i];
            sums[i] = before;
            before += value;
        }
        totals[count] = before;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    sum = sums[item];
    for (int i = first; i < last; ++i) {
        const int2 value = totals[i];
        totals[i] = sum;
        sum += value;
    }
}

// Writes the surviving clusters in order, and one new binary node from `first_node` on for each merging pair.
__kernel void merge(__global const int *best, const int paired, __global const int2 *before,
                    __global const int2 *totals, __global const float *rows, __global const int *cluster,
                    __global float *new_rows, __global int *new_cluster, const int stride, const int left,
                    __global NodeBox *boxes, __global NodeLink *links, const int first_node, const int count)
{
    const int i = get_global_id(0);
    if (i < FAR) {
        store_end(new_rows, stride, -1 - i);
        store_end(new_rows, stride, left + i);
    }
    if (i >= count)
        return;
    const int mate = mutual_best(best, i, paired, count);
    if (mate < i)
        return;
    const int2 rank = before[i] + totals[i / CHUNK];
    Box box = load_box(rows, stride, i);
    int node = cluster[i];
    if (mate > i) {
        node = first_node + rank.y;
        join_nodes(boxes, links, node, cluster[i], cluster[mate]);
        const Box other = load_box(rows, stride, mate);
        box.low = min(box.low, other.low);
        box.high = max(box.high, other.high);
    }
    store_box(new_rows, stride, rank.x, box);
    new_cluster[rank.x] = node;
}

// Collapses a binary node to one wide node (WIDTH children): starting from the root, the child with the largest area is
// replaced by its own two children while slots remain. Returns the number of inner children (x) and of leaf packets
// (y).
int2 open_node(__global const NodeBox *boxes, __global const NodeLink *links, const int root, __global int *children)
{
    int open[WIDTH], count = 1;
    float areas[WIDTH];
    open[0] = root;
    areas[0] = links[open[0]].leaf ? -1.0f : INFINITY;
    while (count < WIDTH) {
        int widest = 0;
        for (int k = 1; k < count; ++k)
            if (areas[k] > areas[widest])
                widest = k;
        if (areas[widest] < 0.0f)
            break;
        const NodeLink link = links[open[widest]];
        open[count] = link.right;
        open[widest] = link.left;
        for (int k = 0; k < 2; ++k) {
            const int at = k ? count : widest, node = open[at];
            areas[at] = links[node].leaf ? -1.0f : area_of(boxes, node);
        }
        ++count;
    }
    int2 sum = 0;
    for (int k = 0; k < count; ++k) {
        const NodeLink link = links[open[k]];
        sum += link.leaf ? (int2)(0, (link.triangles + PACKET - 1) / PACKET) : (int2)(1, 0);
    }
    for (int k = 0; k < WIDTH; ++k)
        children[k] = k < count ? open[k] : -1;
    return sum;
}

// Collapses the binary nodes `roots` of one level to wide nodes. counts: inner children and packets of each.
__kernel void open_nodes(__global const NodeBox *boxes, __global const NodeLink *links, __global const int *roots,
                         __global int *children, __global int2 *counts, const int count_roots)
{
    const int i = get_global_id(0);
    if (i < count_roots)
        counts[i] = open_node(boxes, links, roots[i], children + WIDTH * i);
}

// Collapses successive levels in one work group, which avoids a kernel launch per small level. Stops when a level has
// more than `limit` nodes or `room` is exhausted.
// roots: binary nodes of the first level. next, spare: alternating buffers for the roots of later levels.
// before: index of the first inner child (x) and of the first packet (y) of each wide node, relative to these levels.
// made: numbers of nodes, levels, roots of the next level, and packets.
__kernel void open_levels(__global const NodeBox *boxes, __global const NodeLink *links, __global const int *roots,
                          __global int *next, __global int *spare, __global int *children, __global int2 *before,
                          __global int *made, const int first_count, const int limit, const int room,
                          __local int2 *sums)
{
    const int item = get_local_id(0), items = get_local_size(0);
    int count = first_count, level = 0, nodes = 0, packets = 0;
    while (count > 0 && count <= limit && nodes + count <= room) {
        const int each = (count + items - 1) / items, first = min(item * each, count), last = min(first + each, count);
        int2 sum = 0;
        for (int i = first; i < last; ++i) {
            before[nodes + i] = sum;
            sum += open_node(boxes, links, roots[i], children + WIDTH * (nodes + i));
        }
        sums[item] = sum;
        barrier(CLK_LOCAL_MEM_FENCE);
        if (item == 0) {
            int2 total = 0;
            for (int i = 0; i < items; ++i) {
                const int2 value = sums[i];
                sums[i] = total;
                total += value;
            }
            sums[items] = total;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        const int2 start = sums[item], total = sums[items];
        int rank = start.x;
        for (int i = first; i < last; ++i) {
            before[nodes + i] += start + (int2)(nodes + count, packets);
            for (int k = 0; k < WIDTH; ++k) {
                const int child = children[WIDTH * (nodes + i) + k];
                if (child >= 0 && !links[child].leaf)
                    next[rank++] = child;
            }
        }
        barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
        nodes += count;
        packets += total.y;
        count = total.x;
        ++level;
        roots = next;
        next = spare;
        spare = (__global int *)roots;
    }
    if (item == 0) {
        made[0] = nodes;
        made[1] = level;
        made[2] = count;
        made[3] = packets;
    }
}

// Collects the inner children of a level: the binary nodes from which the next level of wide nodes is built.
__kernel void next_roots(__global const NodeLink *links, __global const int *children, __global const int2 *before,
                         __global const int2 *totals, __global int *next, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    int rank = before[i].x + totals[i / CHUNK].x;
    for (int k = 0; k < WIDTH; ++k) {
        const int child = children[WIDTH * i + k];
        if (child >= 0 && !links[child].leaf)
            next[rank++] = child;
    }
}

// Stores the triangles of a leaf as packets: first corner, two edges, and index, one lane each. Unused lanes have zero
// edges, which no ray hits.
void store_packets(__global const float *positions, __global const NodeLink *links, const int leaf,
                   __global float *packets)
{
    int stack[LEAF + 1], depth = 1, lane = 0;
    stack[0] = leaf;
    while (depth > 0) {
        const NodeLink link = links[stack[--depth]];
        if (link.right >= 0) {
            stack[depth++] = link.right;
            stack[depth++] = link.left;
            continue;
        }
        __global float *packet = packets + lane / PACKET * PACKET * RECORD + lane % PACKET;
        ++lane;
        const float3 a = corner_of(positions, link.left, 0);
        const float3 edge1 = corner_of(positions, link.left, 1) - a;
        const float3 edge2 = corner_of(positions, link.left, 2) - a;
        const float values[10] = {a.x,     a.y,     a.z,     edge1.x, edge1.y,
                                  edge1.z, edge2.x, edge2.y, edge2.z, as_float(link.left)};
        for (int k = 0; k < 10; ++k)
            packet[k * PACKET] = values[k];
    }
    for (; lane % PACKET != 0; ++lane)
        for (int k = 0; k < 10; ++k)
            packets[lane / PACKET * PACKET * RECORD + k * PACKET + lane % PACKET] = 0.0f;
}

// Stores one child of a wide node. With WIDTH 2 the box is stored as centre and half size enlarged by `margin`, else as
// low and high planes. A box at infinity marks a missing child and is stored so that no ray hits it.
void store_child(__global float *record, const Box box, const int code, const float margin)
{
    float3 low = box.low, high = box.high;
#if WIDTH == 2
    const float3 middle = 0.5f * low + 0.5f * high, half_size = max(high - middle, middle - low) + margin;
    const bool missing = isinf(low.x);
    low = missing ? (float3)(0.0f) : middle;
    high = missing ? (float3)(-INFINITY) : half_size;
#endif
    const float values[8] = {low.x, high.x, low.y, high.y, low.z, high.z, as_float(code), 0.0f};
    for (int i = 0; i < 8; ++i)
        record[i * WIDTH] = values[i];
}

// Stores the wide nodes of one level from node `first` on, and the packets of their leaves from `first_packet` on.
// Inner children are numbered from `next` on. Missing children get boxes at infinity.
__kernel void store_level(__global const float *positions, __global const NodeBox *boxes,
                          __global const NodeLink *links, __global const int *children, __global const int2 *before,
                          __global const int2 *totals, const int first, const int next, const int first_packet,
                          __global float *nodes, __global float *packets, const float margin, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const int2 rank = before[i] + totals[i / CHUNK];
    int node = next + rank.x, packet = first_packet + rank.y;
    __global float *record = nodes + (size_t)8 * WIDTH * (first + i);
    for (int k = 0; k < WIDTH; ++k) {
        const int child = children[WIDTH * i + k];
        Box box = {(float3)(INFINITY), (float3)(INFINITY)};
        int code = ~0;
        if (child >= 0) {
            box.low = vload3(0, boxes[child].low);
            box.high = vload3(0, boxes[child].high);
            const NodeLink link = links[child];
            if (link.leaf) {
                const int count = (link.triangles + PACKET - 1) / PACKET;
                store_packets(positions, links, child, packets + (size_t)RECORD * PACKET * packet);
                code = ~(packet << LEAF_BITS | count);
                packet += count;
            } else {
                code = node++;
            }
        }
        store_child(record + k, box, code, margin);
    }
}
