// Replacements of OpenCL C built-ins that call a fused multiply-add, for drivers that cannot link it: Mesa's rusticl
// with an unpatched libclc (Mesa 26.2 with libclc 22). engine/device/driver_options.py prepends this file to programs.

#define OWN static inline __attribute__((overloadable))

// Splits a number into two halves of 12 bits, whose products are exact (Dekker 1971).
OWN float2 own_halves(const float a)
{
    const float scaled = 4097.0f * a, high = scaled - (scaled - a);
    return (float2)(high, a - high);
}

// Returns a * b + c with the rounding errors of the product (Dekker 1971) and the sum (Knuth 1969) added: within a
// rounding of the fused result.
OWN float own_fma(const float a, const float b, const float c)
{
    const float2 x = own_halves(a), y = own_halves(b);
    const float product = a * b, sum = product + c, part = sum - product;
    const float product_error = ((x.x * y.x - product) + x.x * y.y + x.y * y.x) + x.y * y.y;
    const float sum_error = (product - (sum - part)) + (c - part);
    return sum + (product_error + sum_error);
}

OWN float2 own_fma(const float2 a, const float2 b, const float2 c)
{
    return (float2)(own_fma(a.x, b.x, c.x), own_fma(a.y, b.y, c.y));
}

OWN float own_sin(const float x) { return sinpi(x * M_1_PI_F); }
OWN float own_cos(const float x) { return cospi(x * M_1_PI_F); }
OWN float own_tan(const float x) { return own_sin(x) / own_cos(x); }

#define fma own_fma
#define sin own_sin
#define cos own_cos
#define tan own_tan
