// A few rays around a receiver's normal, which follow the cosine.

#define LOOKS 16

float3 look(const int i, const float3 x, const float3 y, const float3 z)
{
    const float2 q = disk((float2)((i + 0.5f) / LOOKS, i * 0.618034f));
    return q.x * x + q.y * y + sqrt(fmax(1.0f - dot(q, q), 0.0f)) * z;
}
