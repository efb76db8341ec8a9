#include "bvh_traversal.cl"
#include "receiver.cl"
#include "visibility_sample.cl"
#include "view_samples.cl"
#include "trace_sample.cl"

// Updates cached visibility after objects moved: only samples whose rays may hit something else are traced again.

// Bounds, on the unit square of sample points, of the samples that can hit a bounding ball. x (squared sine of the
// angle to the normal) lies in low..high; y (turn around the normal, 0..1) is within `half_width` of `middle`. Other
// samples need no ray.
typedef struct {
    float low, high, middle, half_width;
} Window;

#ifdef COSINE
// Slack for rounding, in radians of angles and in units of the square (chosen).
#define ROUNDING 1e-3f

Window window_on(const View *view, const float4 ball)
{
    Window window = {0.0f, 1.0f, 0.0f, 1.0f};
    const float3 way = ball.xyz - view->eye;
    const float distance = length(way);
    if (!(distance > ball.w))
        return window;
    const float spread = asin(ball.w / distance) + ROUNDING;
    const float lean = acos(clamp(dot(way, view->normal) / distance, -1.0f, 1.0f));
    const float low = sin(clamp(lean - spread, 0.0f, M_PI_2_F)), high = sin(fmin(lean + spread, M_PI_2_F));
    window.low = lean - spread < M_PI_2_F ? low * low - ROUNDING : INFINITY;
    window.high = high * high + ROUNDING;
    window.middle = 0.5f * atan2pi(dot(way, view->up), dot(way, view->right));
    if (lean > spread && lean + spread < M_PI_F)
        window.half_width = 0.5f * asinpi(fmin(sin(spread) / sin(lean), 1.0f)) + ROUNDING;
    return window;
}

bool leads_into(const Window *window, const View *view, const int i, __global const uint2 *sequence)
{
    const float2 u = convert_float2(sequence[i] + view->shift) * (1.0f / 4294967296.0f);
    const float turn = u.y - window->middle;
    return u.x >= window->low && u.x <= window->high && fabs(turn - rint(turn)) <= window->half_width;
}
#else
Window window_on(const View *view, const float4 ball)
{
    const Window window = {0.0f, 1.0f, 0.0f, 1.0f};
    return window;
}

bool leads_into(const Window *window, const View *view, const int i, __global const float *multiplier) { return true; }
#endif

// Updates the cached rows of patches to what `trace_visibility` would store now.
// moved_nodes, moved_triangles: BVH of moved triangles, at both old and new positions.
// moved_ball: bounding ball of these, centre and radius, world space.
// moved_views: 1 for patches whose own viewpoint moved; all their samples are traced.
// A ray that misses all moved triangles keeps its entry. Rows do not store back faces, whose emission is summed, so a
// changed row traces its back-face samples (entry 0) too.
__kernel void retrace_visibility(LOOK_ARGUMENTS, const int start, const int cached_from, __global Front *cache,
                                 __global float4 *back_light, __global float *patches_seen, __global uchar *backs_seen,
                                 __global float4 *back_l1, __local float4 *partial, __global const Node *moved_nodes,
                                 __global const PART *moved_triangles, const float4 moved_ball,
                                 __global const uchar *moved_views)
{
    const int patch = start + get_group_id(0);
    const Rays rays = RAYS;
    Rays moved = rays;
    moved.nodes = moved_nodes;
    moved.triangles = moved_triangles;
    const Lightmaps lightmaps = {uvs, atlases, texel_to_patch, resolution, backs};
    const Receiver receiver = load_receiver(receivers + patch);
    const View view = view_of(&receiver, patch, samples, salt, rotate);

    // Ray origins are jittered over the texel, so the ball is enlarged by the texel's extent.
    const float reach = 0.5f * (length(receiver.edge_u) + length(receiver.edge_v)) + 2.0f * receiver.height;
    const Window window = window_on(&view, moved_ball + (float4)(0.0f, 0.0f, 0.0f, reach));
    __global Front *row = cache + (size_t)(patch - cached_from) * samples;
    const bool all = moved_views[patch] || distance(receiver.at, moved_ball.xyz) <= moved_ball.w + reach;

    // Invalidate samples whose rays hit moved geometry: entry 0, the same as samples that hit back faces.
    int forgotten = all;
    Eye eye = {view.eye, -1};
    for (int i = get_local_id(0); i < samples; i += get_local_size(0)) {
        if (!all && !leads_into(&window, &view, i, pattern))
            continue;
        advance_origin(&eye, &view, &rays, &receiver, i, samples);
        if (all || meets_anything(&moved, eye.at, sample_direction(&view, i, pattern, n))) {
            row[i] = 0;
            forgotten = 1;
        }
    }
    if (sum_of_group((float4)(forgotten), partial).x == 0.0f)
        return;

    // Trace the invalid samples and sum the whole row, like `trace_visibility`.
    ViewSum sum = {(float4)(0.0f)};
    for (int i = get_local_id(0); i < samples; i += get_local_size(0)) {
        uint kept = row[i], tint = TINT_INDEX(kept), seen = ENTRY(kept) == outside ? SKY : ENTRY(kept);
        float3 direction = view.normal;
        if (kept == 0) {
            direction = sample_direction(&view, i, pattern, n);
            if (!(dot(direction, view.horizon) > 0.0f))
                continue;
            advance_origin(&eye, &view, &rays, &receiver, i, samples);
            seen = trace_sample(&rays, &lightmaps, eye.at, direction, &tint);
        }
        row[i] = encode_sample(seen, tint, WEIGHT(i), direction, view.normal, emission, backs_seen, outside,
                               RAY_TINTS(rays), &sum);
    }
    store_view(&sum, patch, back_light, patches_seen, back_l1, partial);
}
