// Where light is received: a patch, the start of its rays, directions around its normal.

// float4 of a record, which engine/receivers.py packs.
#define RECEIVER 7

typedef struct {
    float3 at, normal, geometric, edge_u, edge_v;  // world space, metres; steps of a texel
    float3 corner, edge1, edge2, lift;             // its triangle; how far rays start outside of it
    float height, size;                            // of the start of rays above the surface; of the texel
} Receiver;

Receiver load_receiver(__global const float4 *record)
{
    const Receiver r = {record[0].xyz, record[1].xyz, record[2].xyz, record[3].xyz, record[4].xyz,
                        (float3)(record[3].w, record[4].w, record[2].w), record[5].xyz, record[6].xyz,
                        (float3)(record[1].w, record[5].w, record[6].w), record[0].w,
                        fmax(length(record[3].xyz), length(record[4].xyz))};
    return r;
}

uint hash(uint x)
{
    // lowbias32 (Wellons 2018)
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

void basis(const float3 z, float3 *x, float3 *y)
{
    // Duff et al. 2017
    const float sign = z.z < 0.0f ? -1.0f : 1.0f, a = -1.0f / (sign + z.z), b = z.x * z.y * a;
    *x = (float3)(1.0f + sign * z.x * z.x * a, sign * b, -sign * z.x);
    *y = (float3)(b, sign + z.y * z.y * a, -z.y);
}

float2 disk(const float2 u)
{
    const float radius = sqrt(u.x), angle = 2.0f * u.y;
    return radius * (float2)(cospi(angle), sinpi(angle));
}
