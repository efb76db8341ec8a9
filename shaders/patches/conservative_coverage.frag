#version 410
// Keeps the texels that a triangle touches. If several triangles touch a texel, the one nearest to its centre wins. The
// highest bit marks texels that are touched only; `patches.frag` replaces covered ones.
flat in vec2 a, b, c;
flat in uint triangle;
layout(location = 0) out uint out_triangle;

// Slightly more than half a texel, because texture look-ups on a texel's border may be rounded to either side.
const float HALF_TEXEL = 0.501;

// Returns true if the line through p and q separates the texel square around `centre` from `other`.
bool separates(vec2 p, vec2 q, vec2 other, vec2 centre)
{
    vec2 normal = vec2(p.y - q.y, q.x - p.x);
    float side = dot(normal, other - p);
    float distance = dot(normal, centre - p) * (side < 0.0 ? -1.0 : 1.0);
    return distance + HALF_TEXEL * (abs(normal.x) + abs(normal.y)) <= 0.0;
}

float distance_to_edge(vec2 p, vec2 q, vec2 centre)
{
    vec2 edge = q - p;
    float t = clamp(dot(centre - p, edge) / max(dot(edge, edge), 1e-20), 0.0, 1.0);
    return length(p + t * edge - centre);
}

void main()
{
    vec2 centre = gl_FragCoord.xy;
    vec2 low = min(min(a, b), c), high = max(max(a, b), c);
    bool outside = any(lessThanEqual(high, centre - HALF_TEXEL)) || any(greaterThanEqual(low, centre + HALF_TEXEL));
    if (outside || separates(a, b, c, centre) || separates(b, c, a, centre) || separates(c, a, b, centre))
        discard;
    float distance = min(min(distance_to_edge(a, b, centre), distance_to_edge(b, c, centre)),
                         distance_to_edge(c, a, centre));
    gl_FragDepth = min(distance, 0.999);
    out_triangle = triangle | 0x80000000u;
}
