// Triangles that may stand between a texel and a triangle that shines: those that reach into the shaft around both (Haines
// and Wallace, "Shaft Culling for Efficient Ray-Traced Radiosity", 1991). Where none do, all rays arrive; a few are
// tested without a descent. For processors: on a card the items of a warp would wait for the one with the widest shaft.

#define UNKNOWN_BLOCKERS (PACKET + 1)

#if PACKET == 8
#define SIDES 5

typedef struct {
    int count;             // UNKNOWN_BLOCKERS for more than a packet holds
    LANES triangles[10];   // a packet of them, as `meet` takes it
} Blockers;

// Planes around all ways from a texel to a triangle: what is within has dot(normal, x - start) of at most `most`.
typedef struct {
    float3 start;  // above the middle of the texel
    float3 normals[SIDES];
    float most[SIDES];
} Shaft;

// The shaft stays apart from the planes of texel and triangle, as rays do. False if there is none: where the texel is on
// a smooth surface, whose rays start elsewhere, near the triangle's plane, or as small as rounding.
bool make_shaft(__global const Emitter *e, const Receiver *r, Shaft *shaft)
{
    const float3 start = r->at + r->height * r->geometric, across = r->edge_u + r->edge_v, along = r->edge_u - r->edge_v;
    const float radius = 0.501f * sqrt(fmax(dot(across, across), dot(along, along)));
    const float3 edge1 = vload3(0, e->edge1), edge2 = vload3(0, e->edge2), face = cross(edge1, edge2);
    const float3 a = vload3(0, e->position) - start, corners[3] = {a, a + edge1, a + edge2};
    const float twice = length(face);
    if (r->lifted > 0.0f || !(twice > 0.0f))
        return false;
    const float3 towards = (dot(face, a) > 0.0f ? face : -face) / twice;
    const float distance = dot(towards, a);
    if (!(distance > 2.0f * radius))
        return false;
    shaft->start = start;
    for (int k = 0; k < 3; ++k) {
        const float3 from = corners[k], to = corners[k == 2 ? 0 : k + 1], other = corners[k == 0 ? 2 : k - 1];
        const float3 side = cross(from, to);
        const float size = length(side), third = dot(side, other);
        if (!(fabs(third) > 1e-5f * size * length(other)))
            return false;
        shaft->normals[k] = side * ((third > 0.0f ? -1.0f : 1.0f) / size);
        shaft->most[k] = radius;
    }
    shaft->normals[3] = -r->geometric;
    shaft->most[3] = 0.5f * r->height;
    shaft->normals[4] = towards;
    shaft->most[4] = distance - 1e-4f * (distance - radius);
    return true;
}

// Of the children of a node those whose boxes reach into a shaft, as bits.
PART_OF_DESCENT int boxes_within(__global const Node *node, const Shaft *shaft)
{
    const PLANES x = node->x - shaft->start.x, y = node->y - shaft->start.y, z = node->z - shaft->start.z;
    INTS outside = 0;
    for (int k = 0; k < SIDES; ++k) {
        const float3 n = shaft->normals[k];
        outside |= n.x * (n.x > 0.0f ? x.lo : x.hi) + n.y * (n.y > 0.0f ? y.lo : y.hi) + n.z * (n.z > 0.0f ? z.lo : z.hi)
            > shaft->most[k];
    }
    return ~BITS_OF(outside) & 255;
}

// Of the triangles of a packet those that reach into a shaft, as bits.
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
    return ~BITS_OF(outside) & 255;
}

// Adds the triangles of a leaf that reach into a shaft.
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

__attribute__((noinline))
void find_blockers(const Rays *rays, __global const Emitter *e, const Receiver *r, Blockers *blockers)
{
    Shaft shaft;
    blockers->count = UNKNOWN_BLOCKERS;
    if (!make_shaft(e, r, &shaft))
        return;
    blockers->count = 0;
    for (int k = 0; k < 10; ++k)
        blockers->triangles[k] = 0.0f;
    int stack[STACK], depth = 0;
    for (int node = 0;;) {
        __global const Node *wide = rays->nodes + node;
        for (int within = boxes_within(wide, &shaft); within; within &= within - 1) {
            const int child = ((__global const int *)&wide->children)[31 - clz(within & -within)];
            if (child >= 0)
                stack[depth++] = child;
            else
                add_blockers(rays, ~child, &shaft, blockers);
            if (blockers->count > PACKET)
                return;
        }
        if (depth == 0)
            return;
        node = stack[--depth];
    }
}

// Whether nothing is in the way of a ray that a shaft holds, up to a distance.
bool passes(const Blockers *blockers, const float3 origin, const float3 direction, const float distance)
{
    const Search search = search_for(ALL, origin, direction, distance);
    Meeting meeting;
    meet(blockers->triangles, &search, &meeting);
    return BITS_OF(meeting.met) == 0;
}
#else
typedef struct {
    int count;
} Blockers;

void find_blockers(const Rays *rays, __global const Emitter *e, const Receiver *r, Blockers *blockers)
{
    blockers->count = UNKNOWN_BLOCKERS;
}

bool passes(const Blockers *blockers, const float3 origin, const float3 direction, const float distance)
{
    return true;
}
#endif
