// Inline replacements of frequent OpenCL C built-ins for PoCL on CPUs. PoCL ships a built-in library per CPU family. On
// newer CPUs LLVM does not inline it, and each `min` becomes a call that saves all vector registers. Results agree
// except for rounding. engine/device/cl_device.py prepends this file to programs.

// The one-line functions below read as a table.
// clang-format off
#define INLINED __attribute__((overloadable, always_inline)) inline

// PAIRED defines min, max and clamp for type T; PAIRED_WITH defines them for a vector type T with a scalar ONE.
#define PAIRED(T) \
    INLINED T inlined_min(const T a, const T b) { return b < a ? b : a; } \
    INLINED T inlined_max(const T a, const T b) { return a < b ? b : a; } \
    INLINED T inlined_clamp(const T a, const T low, const T high) { return inlined_min(inlined_max(a, low), high); }
#define PAIRED_WITH(T, ONE) \
    PAIRED(T) \
    INLINED T inlined_min(const T a, const ONE b) { return inlined_min(a, (T)(b)); } \
    INLINED T inlined_max(const T a, const ONE b) { return inlined_max(a, (T)(b)); } \
    INLINED T inlined_clamp(const T a, const ONE low, const ONE high) { return inlined_clamp(a, (T)(low), (T)(high)); }

PAIRED(float)
PAIRED_WITH(float2, float)
PAIRED_WITH(float3, float)
PAIRED_WITH(float4, float)
PAIRED_WITH(float8, float)
PAIRED(int)
PAIRED_WITH(int2, int)
PAIRED_WITH(int4, int)
PAIRED(uint)
PAIRED_WITH(uint2, uint)
PAIRED(long)
PAIRED(ulong)

// fmin and fmax return the other operand if one is NaN.
INLINED float inlined_fmin(const float a, const float b) { return (a < b || b != b) ? a : b; }
INLINED float inlined_fmax(const float a, const float b) { return (a > b || b != b) ? a : b; }
#define NUMBERED(T) \
    INLINED T inlined_fmin(const T a, const T b) { return ((a < b) | (b != b)) ? a : b; } \
    INLINED T inlined_fmax(const T a, const T b) { return ((a > b) | (b != b)) ? a : b; } \
    INLINED T inlined_fmin(const T a, const float b) { return inlined_fmin(a, (T)(b)); } \
    INLINED T inlined_fmax(const T a, const float b) { return inlined_fmax(a, (T)(b)); }

NUMBERED(float2)
NUMBERED(float3)
NUMBERED(float4)

INLINED float inlined_mix(const float a, const float b, const float part) { return a + (b - a) * part; }
#define MIXED(T) \
    INLINED T inlined_mix(const T a, const T b, const T part) { return a + (b - a) * part; } \
    INLINED T inlined_mix(const T a, const T b, const float part) { return a + (b - a) * part; }

MIXED(float2)
MIXED(float3)
MIXED(float4)

INLINED float inlined_dot(const float2 a, const float2 b) { return a.x * b.x + a.y * b.y; }
INLINED float inlined_dot(const float3 a, const float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
INLINED float inlined_dot(const float4 a, const float4 b) { return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w; }
INLINED float3 inlined_cross(const float3 a, const float3 b) { return a.yzx * b.zxy - a.zxy * b.yzx; }

// Range of squares that float32 holds without underflow or overflow. Outside it the library function is called.
#define SQUARES_FROM 1e-30f
#define SQUARES_TO 1e30f
#define MEASURED(T) \
    INLINED float inlined_length(const T a) \
    { \
        const float square = inlined_dot(a, a); \
        return square > SQUARES_FROM && square < SQUARES_TO ? __builtin_sqrtf(square) : length(a); \
    } \
    INLINED T inlined_normalize(const T a) \
    { \
        const float square = inlined_dot(a, a); \
        return square > SQUARES_FROM && square < SQUARES_TO ? a * (1.0f / __builtin_sqrtf(square)) : normalize(a); \
    }

MEASURED(float2)
MEASURED(float3)

INLINED float inlined_sqrt(const float a) { return __builtin_sqrtf(a); }
INLINED float3 inlined_sqrt(const float3 a)
{
    return (float3)(__builtin_sqrtf(a.x), __builtin_sqrtf(a.y), __builtin_sqrtf(a.z));
}
INLINED float inlined_rsqrt(const float a) { return 1.0f / __builtin_sqrtf(a); }
INLINED float inlined_rint(const float a) { return __builtin_rintf(a); }
INLINED float inlined_floor(const float a) { return __builtin_floorf(a); }
INLINED float2 inlined_floor(const float2 a) { return (float2)(__builtin_floorf(a.x), __builtin_floorf(a.y)); }
INLINED float inlined_fabs(const float a) { return __builtin_fabsf(a); }
#define ABSOLUTE(F, I) \
    INLINED F inlined_fabs(const F a) { return __builtin_astype(__builtin_astype(a, I) & 0x7fffffff, F); }

ABSOLUTE(float2, int2)
ABSOLUTE(float3, int3)
ABSOLUTE(float4, int4)
ABSOLUTE(float8, int8)

// Minimax polynomials with relative errors below float32 rounding: sine and cosine of pi x on |x| <= 1/4, and arc
// tangent on [0, 1].
INLINED float sine_near_0(const float z)
{
    return 3.14159274f + z * (-5.16770792f + z * (2.54976106f - z * 0.589012206f));
}
INLINED float cosine_near_0(const float z)
{
    return 1.0f + z * (-4.93480206f + z * (4.05870676f + z * (-1.33503592f + z * 0.231260926f)));
}
INLINED float inlined_sinpi(const float a)
{
    const float quarter = __builtin_rintf(2.0f * a), x = a - 0.5f * quarter;
    const int turn = (int)quarter;
    const float sine = turn & 1 ? cosine_near_0(x * x) : x * sine_near_0(x * x);
    return turn & 2 ? -sine : sine;
}
INLINED float inlined_cospi(const float a)
{
    const float quarter = __builtin_rintf(2.0f * a), x = a - 0.5f * quarter;
    const int turn = (int)quarter;
    const float cosine = turn & 1 ? x * sine_near_0(x * x) : cosine_near_0(x * x);
    return (turn + 1) & 2 ? -cosine : cosine;
}
INLINED float inlined_atan2(const float y, const float x)
{
    const float high = __builtin_fabsf(y), wide = __builtin_fabsf(x);
    const float less = high < wide ? high : wide, more = high < wide ? wide : high;
    const float a = more > 0.0f ? less / more : 0.0f, z = a * a;
    float angle = a * (1.0f + z * (-0.333330721f + z * (0.199926198f + z * (-0.142036438f + z * (0.106409334f
        + z * (-0.0750429407f + z * (0.0426915102f + z * (-0.0160686243f + z * 0.00284988829f))))))));
    angle = high > wide ? 1.57079637f - angle : angle;
    angle = __builtin_signbit(x) ? 3.14159274f - angle : angle;
    return __builtin_copysignf(angle, y);
}
INLINED float3 inlined_atan2(const float3 y, const float3 x)
{
    const float3 high = inlined_fabs(y), wide = inlined_fabs(x);
    const float3 less = inlined_min(high, wide), more = inlined_max(high, wide);
    const float3 a = more > 0.0f ? less / more : (float3)(0.0f), z = a * a;
    float3 angle = a * (1.0f + z * (-0.333330721f + z * (0.199926198f + z * (-0.142036438f + z * (0.106409334f
        + z * (-0.0750429407f + z * (0.0426915102f + z * (-0.0160686243f + z * 0.00284988829f))))))));
    angle = high > wide ? 1.57079637f - angle : angle;
    angle = __builtin_astype(x, int3) < 0 ? 3.14159274f - angle : angle;
    const int3 sign = __builtin_astype(y, int3) & (int)0x80000000;
    return __builtin_astype(__builtin_astype(angle, int3) | sign, float3);
}

INLINED int inlined_clz(const int a) { return a == 0 ? 32 : __builtin_clz((uint)a); }
INLINED uint inlined_clz(const uint a) { return a == 0 ? 32 : (uint)__builtin_clz(a); }

INLINED int inlined_any(const int a) { return a != 0; }
INLINED int inlined_any(const int2 a) { return (a.x | a.y) < 0; }
INLINED int inlined_any(const int3 a) { return (a.x | a.y | a.z) < 0; }
INLINED int inlined_any(const int4 a) { return (a.x | a.y | a.z | a.w) < 0; }
INLINED int inlined_any(const int8 a) { return inlined_any(a.lo | a.hi); }

#define LOADED(SPACE, ONE) \
    INLINED ONE##2 inlined_vload2(const size_t i, SPACE const ONE *p) { return (ONE##2)(p[2 * i], p[2 * i + 1]); } \
    INLINED ONE##3 inlined_vload3(const size_t i, SPACE const ONE *p) \
    { \
        return (ONE##3)(p[3 * i], p[3 * i + 1], p[3 * i + 2]); \
    }

LOADED(__global, float)
LOADED(__global, int)
LOADED(__private, float)
LOADED(__private, int)

// PoCL defines some of these names as macros, so each is undefined first.
#undef min
#define min inlined_min
#undef max
#define max inlined_max
#undef clamp
#define clamp inlined_clamp
#undef fmin
#define fmin inlined_fmin
#undef fmax
#define fmax inlined_fmax
#undef mix
#define mix inlined_mix
#undef dot
#define dot inlined_dot
#undef cross
#define cross inlined_cross
#undef length
#define length inlined_length
#undef normalize
#define normalize inlined_normalize
#undef sqrt
#define sqrt inlined_sqrt
#undef rsqrt
#define rsqrt inlined_rsqrt
#undef rint
#define rint inlined_rint
#undef floor
#define floor inlined_floor
#undef sinpi
#define sinpi inlined_sinpi
#undef cospi
#define cospi inlined_cospi
#undef atan2
#define atan2 inlined_atan2
#undef fabs
#define fabs inlined_fabs
#undef clz
#define clz inlined_clz
#undef any
#define any inlined_any
#undef vload2
#define vload2 inlined_vload2
#undef vload3
#define vload3 inlined_vload3
// clang-format on
