// Layout of hemicubes in a texture array, directions of their texels, and sums over a work group.
layout(local_size_x = 256) in;
const uint GROUP = 256u;
const float PI = 3.14159265358979;

struct Frame { vec4 right, up, normal, horizon; };
layout(std430, binding = 0) readonly buffer Frames { Frame frames[]; };
layout(std430, binding = 1) readonly buffer Multiplier { float multiplier[]; };

// Width of a hemicube, and its binary logarithm.
uniform int n;
uniform int log_n;
uniform int columns;
uniform int tiles_per_layer;

// Returns texel (0, 0) of a hemicube in the texture array.
ivec3 origin(int slot)
{
    int tile = slot % tiles_per_layer;
    return ivec3(tile % columns * n, tile / columns * 3 * n, slot / tiles_per_layer);
}

// Returns the position of the i-th texel of a hemicube, row by row.
ivec2 texel_at(int i)
{
    return ivec2(i & (n - 1), i >> log_n);
}

// Returns the direction of a texel of an unfolded hemicube along right, up and normal. Not normalised.
vec3 texel_direction(ivec2 at)
{
    int x = at.x, y = at.y;
    float across = float(2 * x + 1) / float(n) - 1.0;
    if (y < n)
        return vec3(across, float(2 * y + 1) / float(n) - 1.0, 1.0);
    int side = (y - n) >> (log_n - 1);
    float height = float(2 * ((y - n) & (n / 2 - 1)) + 1) / float(n);
    float forward = (side & 1) == 0 ? 1.0 : -1.0;
    return side < 2 ? vec3(forward, forward * across, height) : vec3(-forward * across, forward, height);
}

#ifdef SKY
uniform sampler2D sky;

// Returns the background radiance in a world-space direction: bilinear look-up in an equirectangular map whose row 0 is
// at the bottom (Cycles, kernel/camera/projection.h).
vec3 background_radiance(Frame frame, vec3 along)
{
    vec3 direction = along.x * frame.right.xyz + along.y * frame.up.xyz + along.z * frame.normal.xyz;
    ivec2 size = textureSize(sky, 0);
    float polar = atan(length(direction.xy), direction.z);
    vec2 pixel = vec2(0.5 - atan(direction.y, direction.x) / (2.0 * PI), 1.0 - polar / PI) * vec2(size) - 0.5;
    ivec2 low = ivec2(floor(pixel));
    vec2 f = pixel - vec2(low);
    int x0 = (low.x + size.x) % size.x, x1 = (x0 + 1) % size.x;
    int y0 = clamp(low.y, 0, size.y - 1), y1 = clamp(low.y + 1, 0, size.y - 1);
    vec3 below = mix(texelFetch(sky, ivec2(x0, y0), 0).rgb, texelFetch(sky, ivec2(x1, y0), 0).rgb, f.x);
    vec3 above = mix(texelFetch(sky, ivec2(x0, y1), 0).rgb, texelFetch(sky, ivec2(x1, y1), 0).rgb, f.x);
    return mix(below, above, f.y);
}
#endif

shared vec4 partial_sums[GROUP];

// Returns the sum over all invocations of the work group, always added in the same order; valid in the first
// invocation.
vec4 sum_of_group(vec4 value)
{
    uint item = gl_LocalInvocationIndex;
    partial_sums[item] = value;
    barrier();
    for (uint step = GROUP / 2u; step > 0u; step /= 2u) {
        if (item < step)
            partial_sums[item] += partial_sums[item + step];
        barrier();
    }
    return partial_sums[0];
}
