#pragma once

// Real spherical harmonics up to band 2 (Ramamoorthi and Hanrahan 2001), without Condon-Shortley phase. Order: 1; y, z,
// x; xy, yz, 3z^2 - 1, xz, x^2 - y^2 (engine/probes/spherical_harmonics.py).
#define BASIS 9

// Factors of the polynomials above.
#define BAND_0 0.28209479f
#define BAND_1 0.48860251f
#define PRODUCTS 1.09254843f
#define SQUARE 0.31539157f
#define DIFFERENCE 0.54627422f

// Bit of a probe's sample: a back face with patches of its own that is nearer than LIT_FROM texels. It counts as dark,
// since its texels may extend to where light is (engine/validity/thresholds.py).
#define NEAR_BACK 0x40000000u

typedef struct {
    float3 of[BASIS];  // rgb of each coefficient
} ProbeLight;

// Adds light from a unit direction: radiance times solid angle.
void add_direction(ProbeLight *sum, const float3 d, const float3 light)
{
    sum->of[0] += BAND_0 * light;
    sum->of[1] += BAND_1 * d.y * light;
    sum->of[2] += BAND_1 * d.z * light;
    sum->of[3] += BAND_1 * d.x * light;
    sum->of[4] += PRODUCTS * d.x * d.y * light;
    sum->of[5] += PRODUCTS * d.y * d.z * light;
    sum->of[6] += SQUARE * (3.0f * d.z * d.z - 1.0f) * light;
    sum->of[7] += PRODUCTS * d.x * d.z * light;
    sum->of[8] += DIFFERENCE * (d.x * d.x - d.y * d.y) * light;
}

// Rotates a vector by a unit quaternion.
float3 rotated(const float4 q, const float3 v)
{
    const float3 twice = 2.0f * cross(q.xyz, v);
    return v + q.w * twice + cross(q.xyz, twice);
}

// Rotates light by a unit quaternion: band 1 as a vector, band 2 as the traceless matrix of second moments.
void rotate_light(ProbeLight *light, const float4 q)
{
    const float3 x = rotated(q, (float3)(1.0f, 0.0f, 0.0f)), y = rotated(q, (float3)(0.0f, 1.0f, 0.0f)),
                 z = rotated(q, (float3)(0.0f, 0.0f, 1.0f));
    const float3 ly = light->of[1], lz = light->of[2], lx = light->of[3];
    light->of[1] = x.y * lx + y.y * ly + z.y * lz;
    light->of[2] = x.z * lx + y.z * ly + z.z * lz;
    light->of[3] = x.x * lx + y.x * ly + z.x * lz;

    const float3 xy = light->of[4] / PRODUCTS, yz = light->of[5] / PRODUCTS, xz = light->of[7] / PRODUCTS;
    const float3 zz = light->of[6] / (3.0f * SQUARE), apart = light->of[8] / DIFFERENCE;
    const float3 xx = 0.5f * (apart - zz), yy = -0.5f * (apart + zz);
    // Rows of the rotated axes times the matrix; then times the axes.
    const float3 ax = x.x * xx + y.x * xy + z.x * xz, ay = x.x * xy + y.x * yy + z.x * yz,
                 az = x.x * xz + y.x * yz + z.x * zz;
    const float3 bx = x.y * xx + y.y * xy + z.y * xz, by = x.y * xy + y.y * yy + z.y * yz,
                 bz = x.y * xz + y.y * yz + z.y * zz;
    const float3 cx = x.z * xx + y.z * xy + z.z * xz, cy = x.z * xy + y.z * yy + z.z * yz,
                 cz = x.z * xz + y.z * yz + z.z * zz;
    const float3 new_xx = ax * x.x + ay * y.x + az * z.x, new_yy = bx * x.y + by * y.y + bz * z.y;
    light->of[4] = PRODUCTS * (ax * x.y + ay * y.y + az * z.y);
    light->of[5] = PRODUCTS * (bx * x.z + by * y.z + bz * z.z);
    light->of[6] = 3.0f * SQUARE * (cx * x.z + cy * y.z + cz * z.z);
    light->of[7] = PRODUCTS * (ax * x.z + ay * y.z + az * z.z);
    light->of[8] = DIFFERENCE * (new_xx - new_yy);
}
