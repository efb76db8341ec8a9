#pragma once

// Real spherical harmonics up to band 2 (Ramamoorthi and Hanrahan 2001), without Condon-Shortley phase. Order: 1; y, z,
// x; xy, yz, 3z^2 - 1, xz, x^2 - y^2 (engine/probes/spherical_harmonics.py).
#define BASIS 9

// Bit of a probe's sample: a back face with patches of its own that is nearer than LIT_FROM texels. It counts as dark,
// since its texels may extend to where light is (engine/validity/thresholds.py).
#define NEAR_BACK 0x40000000u

typedef struct {
    float3 of[BASIS];  // rgb of each coefficient
} ProbeLight;

// Adds light from a unit direction: radiance times solid angle.
void add_direction(ProbeLight *sum, const float3 d, const float3 light)
{
    sum->of[0] += 0.28209479f * light;
    sum->of[1] += 0.48860251f * d.y * light;
    sum->of[2] += 0.48860251f * d.z * light;
    sum->of[3] += 0.48860251f * d.x * light;
    sum->of[4] += 1.09254843f * d.x * d.y * light;
    sum->of[5] += 1.09254843f * d.y * d.z * light;
    sum->of[6] += 0.31539157f * (3.0f * d.z * d.z - 1.0f) * light;
    sum->of[7] += 1.09254843f * d.x * d.z * light;
    sum->of[8] += 0.54627422f * (d.x * d.x - d.y * d.y) * light;
}

// Rotates a vector by a unit quaternion.
float3 rotated(const float4 q, const float3 v)
{
    const float3 twice = 2.0f * cross(q.xyz, v);
    return v + q.w * twice + cross(q.xyz, twice);
}
