// Builds receiver records (receiver.cl) of patches from their triangles and barycentrics.

// Returns the index of a texel along a Hilbert curve through side x side texels, where side is a power of two (Warren,
// Hacker's Delight, section 16-2). Texels close along the curve are close on the lightmap.
uint hilbert(uint x, uint y, const uint side)
{
    uint along = 0;
    for (uint step = side / 2; step > 0; step /= 2) {
        const uint right = (x & step) != 0, up = (y & step) != 0;
        along += step * step * ((3 * right) ^ up);
        if (!up) {
            const uint flip = right ? side - 1 : 0, turned = y ^ flip;
            y = x ^ flip;
            x = turned;
        }
    }
    return along;
}

// Returns the rank of a patch along the Hilbert curve. The `points` sample points of one texel have successive ranks.
uint rank_of(__global const int *texels, const int patch, const int resolution, const int points)
{
    uint side = 1;
    while (side < (uint)resolution)
        side *= 2;
    int before = 0;
    while (before + 1 < points && before < patch && texels[patch - before - 1] == texels[patch])
        ++before;
    return points * hilbert(texels[patch] % resolution, texels[patch] / resolution, side) + before;
}

// Fills the record of each patch. corners, normals: 9 floats per triangle, world space. The ray origin's height above
// the surface is a fraction of the texel width, at most `highest`. It is at least a fraction of the largest coordinate,
// both relative to `origin` and in scene space, because of float32 rounding (engine/visibility/views/viewpoints.py).
__kernel void pack_receivers(__global const int *triangles, __global const float *barycentrics,
                             __global const float *corners, __global const float *normals,
                             __global const TexelStep *steps, const float of_texel, const float highest,
                             const float of_coordinate, const float4 origin, __global const int *texels,
                             const int resolution, const int points, __global ReceiverRecord *records, const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    const int triangle = triangles[patch];
    const float3 w = vload3(patch, barycentrics);
    float3 corner[3], normal[3];
    for (int i = 0; i < 3; ++i) {
        corner[i] = vload3(3 * triangle + i, corners);
        normal[i] = vload3(3 * triangle + i, normals);
    }
    __global const TexelStep *step = steps + triangle;
    const float3 geometric = vload3(0, step->geometric);
    const float3 at = w.x * corner[0] + w.y * corner[1] + w.z * corner[2];
    const float3 mean = w.x * normal[0] + w.y * normal[1] + w.z * normal[2];
    const float size = length(mean);
    const float3 shading = size > 1e-20f ? mean / size : geometric;
    const float3 reach = fmax(fabs(at), fabs(at + origin.xyz));
    const float coordinate = fmax(reach.x, fmax(reach.y, reach.z));
    const float height = fmax(fmin(of_texel * sqrt(step->area), highest), of_coordinate * coordinate);
    __global ReceiverRecord *record = records + patch;
    vstore3(at, 0, record->at);
    record->height = height;
    vstore3(shading, 0, record->normal);
    record->lifted = 0.0f;
    vstore3(geometric, 0, record->geometric);
    vstore3(vload3(0, step->edge_u), 0, record->edge_u);
    vstore3(vload3(0, step->edge_v), 0, record->edge_v);
    vstore3(corner[0], 0, record->corner);
    vstore3(corner[1] - corner[0], 0, record->edge1);
    vstore3(corner[2] - corner[0], 0, record->edge2);
    vstore3(normal[0], 0, record->normal1);
    vstore3(normal[1], 0, record->normal2);
    vstore3(normal[2], 0, record->normal3);
    record->rank = 2 * rank_of(texels, patch, resolution, points);
}
