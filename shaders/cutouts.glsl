// Whether a fragment is a hole: the back of a culled material, or see-through by its alpha. Partial
// alpha keeps that fraction of the fragments, chosen by a hash of their lightmap UV.
uniform usampler2DArray cutout_alpha;
uniform isampler2DArray cutout_maps;
uniform sampler2DArray cutout_constants;

const int REPEAT = 0, MIRROR = 1, CLIP = 3;

// Where a list's entry is in its texture (engine/visibility/table.py).
ivec3 in_table(int i, int height)
{
    int row = i / 4096;
    return ivec3(i % 4096, row % height, row / height);
}

// Pixels begin at -1, see near_image: GLSL leaves remainders of negative numbers open. Integers, since a card's
// quotient of two equal floats may be a little less than 1.
int wrapped(int i, int size, int extension)
{
    if (extension == REPEAT)
        return (i + size) % size;
    if (extension == MIRROR) {
        int folded = (i + 2 * size) % (2 * size);
        return min(folded, 2 * size - 1 - folded);
    }
    return clamp(i, 0, size - 1);
}

float alpha_pixel(ivec2 p, ivec4 map)
{
    ivec2 size = map.yz;
    if (map.w % 4 == CLIP && (any(lessThan(p, ivec2(0))) || any(greaterThanEqual(p, size))))
        return 0.0;
    int pixel = map.x + wrapped(p.y, size.y, map.w % 4) * size.x + wrapped(p.x, size.x, map.w % 4);
    uint alpha = texelFetch(cutout_alpha, in_table(pixel, textureSize(cutout_alpha, 0).y), 0).r;
    return float(alpha) / 65535.0;
}

// The same point on the image or beside it, where int can count the pixels.
vec2 near_image(vec2 uv, int extension)
{
    if (extension == REPEAT)
        return uv - floor(uv);
    if (extension == MIRROR)
        return uv - 2.0 * floor(0.5 * uv);
    return clamp(uv, -1.0, 2.0);
}

float map_alpha(vec2 uv, ivec4 map)
{
    if (map.y == 0)
        return 1.0;
    vec2 pixel = near_image(uv, map.w % 4) * vec2(map.yz);
    if (map.w >= 4)
        return alpha_pixel(ivec2(floor(pixel)), map);
    ivec2 low = ivec2(floor(pixel - 0.5));
    vec2 f = pixel - 0.5 - vec2(low);
    return mix(mix(alpha_pixel(low, map), alpha_pixel(low + ivec2(1, 0), map), f.x),
               mix(alpha_pixel(low + ivec2(0, 1), map), alpha_pixel(low + ivec2(1, 1), map), f.x), f.y);
}

// lowbias32 (Wellons 2018)
uint hash(uint x)
{
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

bool is_hole(vec3 cutout, vec2 lightmap_uv)
{
    int material = int(cutout.z + 0.5);
    ivec3 entry = in_table(material, textureSize(cutout_constants, 0).y);
    vec4 constants = texelFetch(cutout_constants, entry, 0);
    if (constants.z > 0.0 && !gl_FrontFacing)
        return true;
    float alpha = constants.x * map_alpha(cutout.xy, texelFetch(cutout_maps, entry, 0));
    if (constants.y >= 0.0)
        return alpha < constants.y;
    if (alpha >= 1.0)
        return false;
    uint seed = hash(floatBitsToUint(lightmap_uv.x) ^ uint(material));
    seed = hash(seed ^ floatBitsToUint(lightmap_uv.y));
    return float(seed >> 8) * (1.0 / 16777216.0) >= alpha;
}
