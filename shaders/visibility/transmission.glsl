// Tests whether a fragment is a hole, through which light passes. Partial opacity keeps that fraction of the fragments,
// chosen by a hash of their lightmap UV. For tinted surfaces the channel with the largest transmittance counts.
uniform usampler2DArray cutout_pixels;
uniform isampler2DArray cutout_maps;
uniform sampler2DArray cutout_constants;

const int REPEAT = 0, MIRROR = 1, CLIP = 3;

// Returns the texel of entry i of a list in its texture (engine/visibility/raster/list_texture.py).
ivec3 in_table(int i, int height)
{
    int row = i / 4096;
    return ivec3(i % 4096, row % height, row / height);
}

// Coordinates of pixels start at -1, see `near_image`, because GLSL does not define remainders of negative numbers.
// Integers are used because a GPU's quotient of two equal floats may be slightly less than 1.
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

// Returns one pixel of a map with 1 or 3 channels (bit 3 of w).
vec3 map_pixel(ivec2 p, ivec4 map)
{
    ivec2 size = map.yz;
    if (map.w % 4 == CLIP && (any(lessThan(p, ivec2(0))) || any(greaterThanEqual(p, size))))
        return vec3(0.0);
    int pixel = wrapped(p.y, size.y, map.w % 4) * size.x + wrapped(p.x, size.x, map.w % 4);
    int channels = map.w >= 8 ? 3 : 1, height = textureSize(cutout_pixels, 0).y;
    vec3 values;
    for (int i = 0; i < 3; ++i) {
        int place = map.x + channels * pixel + min(i, channels - 1);
        values[i] = float(texelFetch(cutout_pixels, in_table(place, height), 0).r) / 65535.0;
    }
    return values;
}

// Returns equivalent coordinates on the image or beside it, where they fit an int.
vec2 near_image(vec2 uv, int extension)
{
    if (extension == REPEAT)
        return uv - floor(uv);
    if (extension == MIRROR)
        return uv - 2.0 * floor(0.5 * uv);
    return clamp(uv, -1.0, 2.0);
}

vec3 map_value(vec2 uv, ivec4 map)
{
    vec2 pixel = near_image(uv, map.w % 4) * vec2(map.yz);
    if (map.w % 8 >= 4)
        return map_pixel(ivec2(floor(pixel)), map);
    ivec2 low = ivec2(floor(pixel - 0.5));
    vec2 f = pixel - 0.5 - vec2(low);
    return mix(mix(map_pixel(low, map), map_pixel(low + ivec2(1, 0), map), f.x),
               mix(map_pixel(low + ivec2(0, 1), map), map_pixel(low + ivec2(1, 1), map), f.x), f.y);
}

// lowbias32 (Wellons 2018)
uint hash(uint x)
{
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

// cutout: UV on the map of the front, material; back_uv: UV on the map of the back; cosine: of the angle of incidence,
// for ANGULAR
bool is_hole(vec3 cutout, vec2 back_uv, vec2 lightmap_uv, float cosine)
{
    int material = int(cutout.z + 0.5);
    int record = 2 * material + (gl_FrontFacing ? 0 : 1);
    int height = textureSize(cutout_constants, 0).y;
    vec4 base = texelFetch(cutout_constants, in_table(3 * record, height), 0);
    vec3 opacity = base.rgb;
    ivec4 map = texelFetch(cutout_maps, in_table(record, textureSize(cutout_maps, 0).y), 0);
    if (map.y > 0) {
        vec3 factor = texelFetch(cutout_constants, in_table(3 * record + 1, height), 0).rgb;
        opacity += factor * map_value(gl_FrontFacing ? cutout.xy : back_uv, map);
    }
    float stopped = min(opacity.r, min(opacity.g, opacity.b));
    if (base.a >= 0.0)
        return stopped < base.a;
#ifdef ANGULAR
    vec4 fresnel = texelFetch(cutout_constants, in_table(3 * record + 2, height), 0);
    stopped = at_angle(clamp(stopped, 0.0, 1.0), fresnel, cosine);
#endif
    if (stopped >= 1.0)
        return false;
    uint seed = hash(floatBitsToUint(lightmap_uv.x) ^ uint(material));
    seed = hash(seed ^ floatBitsToUint(lightmap_uv.y));
    return float(seed >> 8) * (1.0 / 16777216.0) >= stopped;
}
