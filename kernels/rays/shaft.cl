#pragma once
#include "bvh_traversal.cl"

// Shaft culling (Haines and Wallace, "Shaft Culling for Efficient Ray-Traced Radiosity", 1991): collects the triangles
// that intersect a shaft, the convex hull of a bundle of rays. Rays of a shaft without triangles are unoccluded; up to
// PACKET triangles are tested without a BVH traversal. Used on CPUs only: on a GPU the lanes of a warp would wait for
// the lane with the widest shaft.

#define UNKNOWN_BLOCKERS (PACKET + 1)

#if PACKET == 8
#define SIDES 5

typedef struct {
    int count;            // UNKNOWN_BLOCKERS if they exceed one packet
    LANES triangles[10];  // one packet in the layout of `meet`
} Blockers;

// Shaft: half-spaces around a texel and three corners beyond it. A point x is inside if dot(normals[k], x - start) <=
//     most[k] for all k. World space, metres.
typedef struct {
    float3 start;  // above the middle of the texel
    float3 normals[SIDES];
    float most[SIDES];
    float3 corners[3];     // from `start`
    float3 across, along;  // from the middle of the texel to its sides
    float slack;           // rounding error of these points, metres
} Shaft;

// Returns a bit mask of the children of a node whose boxes intersect the half-spaces of a shaft.
PART_OF_DESCENT int boxes_within(__global const Node *node, const Shaft *shaft)
{
    const PLANES x = node->x - shaft->start.x, y = node->y - shaft->start.y, z = node->z - shaft->start.z;
    INTS outside = 0;
    for (int k = 0; k < SIDES; ++k) {
        const float3 n = shaft->normals[k];
        outside |=
            n.x * (n.x > 0.0f ? x.lo : x.hi) + n.y * (n.y > 0.0f ? y.lo : y.hi) + n.z * (n.z > 0.0f ? z.lo : z.hi)
            > shaft->most[k];
    }
    return ~BITS_OF(outside) & 255;
}

// Flags the triangles of a packet whose plane has the whole shaft on one side.
PART_OF_DESCENT FLAGS planes_beside(__global const PART *t, const LANES x, const LANES y, const LANES z,
                                    const Shaft *shaft)
{
    const LANES nx = t[4] * t[8] - t[5] * t[7], ny = t[5] * t[6] - t[3] * t[8], nz = t[3] * t[7] - t[4] * t[6];
    const float3 u = shaft->across, v = shaft->along;
    const LANES middle = -(nx * x + ny * y + nz * z);
    const LANES half_size = fabs(nx * u.x + ny * u.y + nz * u.z) + fabs(nx * v.x + ny * v.y + nz * v.z);
    LANES lowest = middle - half_size, highest = middle + half_size;
    for (int k = 0; k < 3; ++k) {
        const float3 corner = shaft->corners[k];
        const LANES above = middle + nx * corner.x + ny * corner.y + nz * corner.z;
        lowest = min(lowest, above);
        highest = max(highest, above);
    }
    const LANES slack = shaft->slack * (fabs(nx) + fabs(ny) + fabs(nz));
    return (lowest >= -slack) | (highest <= slack);
}

// Returns a bit mask of the triangles of a packet that may intersect a shaft.
PART_OF_DESCENT int triangles_within(__global const PART *t, const Shaft *shaft)
{
    const LANES x = t[0] - shaft->start.x, y = t[1] - shaft->start.y, z = t[2] - shaft->start.z;
    FLAGS outside = (t[3] == 0.0f) & (t[4] == 0.0f) & (t[5] == 0.0f);
    for (int k = 0; k < SIDES; ++k) {
        const float3 n = shaft->normals[k];
        const LANES at = n.x * x + n.y * y + n.z * z;
        const LANES first = n.x * t[3] + n.y * t[4] + n.z * t[5], second = n.x * t[6] + n.y * t[7] + n.z * t[8];
        outside |= at + min(min(first, second), 0.0f) > shaft->most[k];
    }
    return ~BITS_OF(outside | planes_beside(t, x, y, z, shaft)) & 255;
}

// Appends the triangles of a leaf that intersect a shaft to its blockers.
PART_OF_DESCENT void add_blockers(const Rays *rays, const int code, const Shaft *shaft, Blockers *blockers)
{
    __global const PART *packet = rays->triangles + PARTS * (code >> LEAF_BITS);
    const int packets = code & ((1 << LEAF_BITS) - 1);
    for (int i = 0; i < packets; ++i, packet += PARTS)
        for (int within = triangles_within(packet, shaft); within; within &= within - 1) {
            if (blockers->count >= PACKET) {
                blockers->count = UNKNOWN_BLOCKERS;
                return;
            }
            const int lane = 31 - clz(within & -within);
            for (int k = 0; k < 10; ++k)
                ((float *)(blockers->triangles + k))[blockers->count] = ((__global const float *)(packet + k))[lane];
            ++blockers->count;
        }
}

PART_OF_DESCENT void find_within(const Rays *rays, const Shaft *shaft, Blockers *blockers)
{
    blockers->count = 0;
    for (int k = 0; k < 10; ++k)
        blockers->triangles[k] = 0.0f;
    int stack[STACK], depth = 0;
    for (int node = 0;;) {
        __global const Node *wide = rays->nodes + node;
        for (int within = boxes_within(wide, shaft); within; within &= within - 1) {
            const int child = ((__global const int *)&wide->children)[31 - clz(within & -within)];
            if (child >= 0)
                stack[depth++] = child;
            else
                add_blockers(rays, ~child, shaft, blockers);
            if (blockers->count > PACKET)
                return;
        }
        if (depth == 0)
            return;
        node = stack[--depth];
    }
}

// Returns true if no blocker intersects a ray of the shaft up to a distance.
bool shaft_is_clear(const Blockers *blockers, const float3 origin, const float3 direction, const float distance)
{
    const Search search = search_for(ALL, BOUNCE, origin, direction, distance);
    Meeting meeting;
    meet(blockers->triangles, &search, &meeting);
    return BITS_OF(meeting.met) == 0;
}
#else
typedef struct {
    int count;
} Blockers;

bool shaft_is_clear(const Blockers *blockers, const float3 origin, const float3 direction, const float distance)
{
    return true;
}
#endif
