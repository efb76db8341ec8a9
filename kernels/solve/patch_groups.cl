#include "receiver.cl"

// Forms patch groups that the solver treats as one patch. Within each square of `width` x `width` texels, patches of
// one material, nearly coplanar and of similar emission follow a representative: the member nearest to their centroid.
// Invalid patches (inside geometry) form groups of their own: they are dark but not visible.

#define MOST 64  // maximum number of texels in a square
#define SAME_PLANE 0.95f

// Maximum difference of radiance before the first bounce, as fractions of the scene's mean and of the patch's own. Near
// a light under a ceiling, hidden patches are much brighter than visible ones; a wrong representative would add or
// remove light.
#define SAME_LIGHT 0.10f
#define AS_BRIGHT 0.05f

// Returns the member nearest to the centroid of the members. Ties alternate between squares (turn), so that the mean
// offset of representatives is zero.
uint middle_of(const uint *members, const int count, __global const int *texels, const int resolution, const int x0,
               const int y0, const int2 turn)
{
    int2 sum = (int2)(0);
    for (int i = 0; i < count; ++i)
        sum += (int2)(texels[members[i]] % resolution - x0, texels[members[i]] / resolution - y0);
    uint nearest = members[0];
    int least = INT_MAX;
    for (int i = 0; i < count; ++i) {
        const int2 at = (int2)(texels[members[i]] % resolution - x0, texels[members[i]] / resolution - y0);
        const int2 way = 4 * (count * at - sum) + turn;
        const int far = way.x * way.x + way.y * way.y;
        if (far < least) {
            least = far;
            nearest = members[i];
        }
    }
    return nearest;
}

__kernel void group_patches(__global const uint *texel_to_patch, const int resolution, const int width,
                            __global const int *texels, __global const int *materials,
                            __global const ReceiverRecord *receivers, __global const float *radiance,
                            const float mean_radiance, __global const uchar *inside, __global uint *leaders)
{
    const int x0 = width * get_global_id(0), y0 = width * get_global_id(1);
    const size_t page = (size_t)get_global_id(2) * resolution * resolution;
    uint members[MOST];
    int count = 0;

    // Collect members by distance from the square's centre. Border texels that only show a neighbouring patch do not
    // count.
    for (int y = y0; y < min(y0 + width, resolution); ++y) {
        for (int x = x0; x < min(x0 + width, resolution); ++x) {
            const uint entry = texel_to_patch[page + (size_t)y * resolution + x];
            if (entry == 0 || texels[entry - 1] != y * resolution + x)
                continue;
            const int dx = 2 * (x - x0) - width + 1, dy = 2 * (y - y0) - width + 1, far = dx * dx + dy * dy;
            int rank = count++;
            for (; rank > 0; --rank) {
                const int other = texels[members[rank - 1]];
                const int ox = 2 * (other % resolution - x0) - width + 1;
                const int oy = 2 * (other / resolution - y0) - width + 1;
                if (ox * ox + oy * oy <= far)
                    break;
                members[rank] = members[rank - 1];
            }
            members[rank] = entry - 1;
        }
    }

    // Each ungrouped patch collects all similar ones; the most central becomes the representative.
    const int2 turn = 1 - 2 * (int2)(get_global_id(1) & 1, get_global_id(0) & 1);
    for (int i = 0; i < count; ++i) {
        const uint leader = members[i];
        if (leader == 0xFFFFFFFFu)
            continue;
        const Receiver r = load_receiver(receivers + leader);
        uint following[MOST];
        int followers = 0;
        for (int j = i; j < count; ++j) {
            const uint member = members[j];
            if (member == 0xFFFFFFFFu)
                continue;
            const Receiver m = load_receiver(receivers + member);
            const bool alike = inside[member] == inside[leader] && materials[member] == materials[leader]
                && dot(m.normal, r.normal) > SAME_PLANE && fabs(dot(m.at - r.at, r.geometric)) < 0.5f * width * r.size
                && length(m.at - r.at) < 1.5f * width * r.size
                && fabs(radiance[member] - radiance[leader])
                    <= SAME_LIGHT * mean_radiance + AS_BRIGHT * fmax(radiance[member], radiance[leader]);
            if (j == i || alike) {
                following[followers++] = member;
                members[j] = 0xFFFFFFFFu;
            }
        }
        const uint middle = middle_of(following, followers, texels, resolution, x0, y0, turn);
        for (int j = 0; j < followers; ++j)
            leaders[following[j]] = middle;
    }
}
