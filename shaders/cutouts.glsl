// Whether a fragment is a hole: the back of a culled material, or see-through by its alpha. Partial
// alpha keeps that share of the fragments, chosen by a hash of their place on the lightmap.
uniform sampler2D cutout_alpha;
uniform isampler2D cutout_maps;
uniform sampler2D cutout_constants;

const int REPEAT = 0, MIRROR = 1, CLIP = 3;

int wrapped(int i, int size, int extension)
{
    if (extension == REPEAT)
        return i - size * int(floor(float(i) / float(size)));
    if (extension == MIRROR) {
        int folded = i - 2 * size * int(floor(float(i) / float(2 * size)));
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
    int width = textureSize(cutout_alpha, 0).x;
    return texelFetch(cutout_alpha, ivec2(pixel % width, pixel / width), 0).r;
}

float map_alpha(vec2 uv, ivec4 map)
{
    if (map.y == 0)
        return 1.0;
    vec2 place = uv * vec2(map.yz);
    if (map.w >= 4)
        return alpha_pixel(ivec2(floor(place)), map);
    ivec2 low = ivec2(floor(place - 0.5));
    vec2 f = place - 0.5 - vec2(low);
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

bool is_hole(vec3 cutout, vec2 place)
{
    ivec2 material = ivec2(int(cutout.z + 0.5), 0);
    vec4 constants = texelFetch(cutout_constants, material, 0);
    if (constants.z > 0.0 && !gl_FrontFacing)
        return true;
    float alpha = constants.x * map_alpha(cutout.xy, texelFetch(cutout_maps, material, 0));
    if (constants.y >= 0.0)
        return alpha < constants.y;
    if (alpha >= 1.0)
        return false;
    uint seed = hash(floatBitsToUint(place.x) ^ uint(material.x));
    seed = hash(seed ^ floatBitsToUint(place.y));
    return float(seed >> 8) * (1.0 / 16777216.0) >= alpha;
}
