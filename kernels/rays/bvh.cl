#pragma once

// Builds the hierarchy of bvh_traversal.cl: clusters of triangles along a Morton curve, each merged with its
// best neighbour if the choice is mutual (PLOC; Meister and Bittner 2018), until few are left, which are
// split from the top down; then binary nodes are joined to nodes of WIDTH children with leaves of packets.
// engine/visibility/rays/bvh.py runs the kernels.

#define FAR 8
#define CHUNK 32  // values that one work item sums
#define LEAF_BITS 3

typedef struct {
    float3 low, high;
} Box;

float half_area(const float3 size) { return size.x * size.y + size.y * size.z + size.z * size.x; }

// The corner of a triangle.
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

// Two zeros before each of the lowest 21 bits.
ulong spread(ulong x)
{
    x = (x | x << 32) & 0x1f00000000ffff;
    x = (x | x << 16) & 0x1f0000ff0000ff;
    x = (x | x << 8) & 0x100f00f00f00f00f;
    x = (x | x << 4) & 0x10c30c30c30c30c3;
    return (x | x << 2) & 0x1249249249249249;
}

// The code of each triangle's box on the Morton curve, above the triangle's number in `number_bits` bits. The
// scene reaches from -1/scale to 1/scale.
__kernel void morton_keys(__global const float *positions, const float scale,
                              const int number_bits, __global ulong *keys, const int count)
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

// Clusters are six rows of coordinates (low and high x, y, z), FAR more at either end, and the node of each.
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

// Nobody merges with what is endless: it stands at both ends of the rows.
void store_end(__global float *rows, const int stride, const int i)
{
    const Box endless = {(float3)(-INFINITY), (float3)(INFINITY)};
    store_box(rows, stride, i, endless);
}

// A node has its box, with the cost of a ray in it (surface area heuristic), and its two children, the
// number of its triangles, and whether it is a leaf. Of a triangle's node the first child is its number.
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

// Makes a node of two others: a leaf if it has few triangles, and to test all is no dearer than to test their boxes.
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

// Every triangle is a cluster and a node, in the order of the curve.
__kernel void single_clusters(__global const float *positions, __global const ulong *keys,
                              const ulong number_mask, __global float *rows, const int stride,
                              __global int *cluster, __global NodeBox *boxes, __global NodeLink *links, const int count)
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

// The neighbour with which each cluster has the smallest box: among equals the other one of its pair, so
// that equal boxes pair up.
__kernel void best_neighbours(__global const float *rows, const int stride, __global int *best,
                              const int count)
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
            const float8 z = max(vload8(0, high + 2 * stride), own.high.z)
                - min(vload8(0, low + 2 * stride), own.low.z);
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

// With which neighbour a cluster merges: with itself unless the choice is mutual. In pairs if `paired`.
int mutual_best(__global const int *best, const int i, const int paired, const int count)
{
    if (paired)
        return min(i ^ 1, count - 1);
    const int other = best[i];
    return best[other] == i ? other : i;
}

// Of each cluster how many before it in its chunk stay, and how many nodes they make; both of each chunk.
__kernel void count_merges(__global const int *best, const int paired, __global int2 *before,
                           __global int2 *totals, const int count)
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

// Sums before each value in its chunk, in place; of each chunk its sum.
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

// Sums before each chunk, in place, and after the last the sum of all. One work group.
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

// The clusters that stay, and new nodes from `first_node` on for those that merge.
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

// The children of a wide node: the binary node's two, and of those that are no leaves the largest opened as
// long as there is room. Returns the number of those that are no leaves, and of the packets of leaves.
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

// The children of each wide node of a level, how many of them are no leaves, and its packets.
__kernel void open_nodes(__global const NodeBox *boxes, __global const NodeLink *links, __global const int *roots,
                         __global int *children, __global int2 *counts, const int count_roots)
{
    const int i = get_global_id(0);
    if (i < count_roots)
        counts[i] = open_node(boxes, links, roots[i], children + WIDTH * i);
}

// All levels from one on while they have at most `limit` wide nodes and there is room for them, one after the other. One
// work group. roots: the binary nodes of the first level; next, spare: of the levels after it, in turns. before: of each
// wide node its first child that is no leaf, and its first packet, from the first node and packet of these levels on.
// made: nodes, levels, nodes of the level that follows, packets.
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

// The binary nodes that the next level of wide nodes is made of.
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

// The packets of a leaf: first corner, two edges and number of each triangle; lanes without one have no edges.
void store_packets(__global const float *positions, __global const NodeLink *links,
                   const int leaf, __global float *packets)
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
        const float values[10] = {a.x, a.y, a.z, edge1.x, edge1.y, edge1.z, edge2.x, edge2.y, edge2.z,
                                  as_float(link.left)};
        for (int k = 0; k < 10; ++k)
            packet[k * PACKET] = values[k];
    }
    for (; lane % PACKET != 0; ++lane)
        for (int k = 0; k < 10; ++k)
            packets[lane / PACKET * PACKET * RECORD + k * PACKET + lane % PACKET] = 0.0f;
}

// A child of a node, as bvh_traversal.cl reads it: the planes of its box, or in nodes of two its middle and
// half its size, larger by a margin. A box at infinity becomes one that no ray meets.
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

// Wide nodes of one level, from `first` on, and the packets of their leaves; their children are nodes from
// `next` on. Boxes of missing children are at infinity.
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
