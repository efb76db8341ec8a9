"""Thresholds that decide whether a point is valid, or invalid because it lies inside geometry.

A ray hits a back face if it arrives at the nearest surface from behind. A back face with patches of its own
that emits or reflects enough light (`DARK_BACK`) counts as a front face.
"""

from __future__ import annotations

from ..device.planned_program import Source
from ..visibility.rays.receiver_records import RECEIVER

#: Number of probe rays of a point: cosine-weighted stratified samples over the hemisphere of its normal. It
#: is LOOKS of kernels/visibility/probe_rays.cl.
PROBES = 16

#: A patch is invalid if more than this fraction of its visibility samples hit back faces. It is below 1,
#: because the foot of a box that is sunk in a floor has a few samples that hit the surroundings.
INVALID = 0.9

#: A patch may be invalid if more than this fraction of its visibility samples hit back faces; probe rays then
#: decide. Between the sides of a thin wall that ends in a ceiling, up to half of the samples hit the front of
#: the ceiling.
DOUBTFUL = 0.4

#: An invalid point has at most this many escapes. A probe ray that hits nothing, or the front of a surface
#: that is itself outside, counts 2: one ray may slip through the edge between two faces. A ray that hits a
#: lit back face at a distance counts 1: light leaks into pockets between parts of a house, so their far ends
#: are lit.
MAX_ESCAPES = 3

#: The front of a surface is outside if at most this many of its probe rays hit back faces. In a corner inside
#: geometry where a wall ends, rays from front faces hit other front faces, and back faces in a quarter of the
#: cases. A texel sample is enclosed if at most this many of its rays hit anything but back faces.
MAX_BACKS_OUTSIDE = PROBES // 4

#: A side of a face is open if at most this many of its probe rays hit back faces. This distinguishes walls of
#: two rooms in one plane from a box on a floor. Above it, a patch counts as inside geometry in texel groups.
MAX_BACKS_OPEN = PROBES // 2

#: Maximum number of probe rays of a backlit point that hit anything else before one hits an emissive back
#: face. A ceiling behind a lamp's panel is backlit.
MAX_OTHERS_BACKLIT = 3

#: Number of first probe rays of a sample point; if none of them hits a back face and one reaches farther than
#: `LIT_FROM`, the point is valid and no more rays are traced.
FIRST_PROBES = 3

#: A light is enclosed if this fraction of its rays hits back faces without patches. It is below 1, because of
#: gaps between the parts of a lamp's body.
ENCLOSED = 0.98

#: A back face is dark and indicates the inside of geometry if its radiosity is below this fraction of the
#: scene's mean radiance. Texels crossed by the wall of a hollow pillar let in 1 to 2 % of the light around
#: its foot. Deliberately lit back faces send out more than a tenth of the mean.
DARK_BACK = 0.03

#: A lit back face counts as dark up to this distance, texels. Below the rim of a shell that lies on a floor,
#: light leaks in through texels that the rim crosses, with dark fringes around the mounds of a garden. With
#: 6, the floor 1.5 texels below a single-plane roof would count as inside.
LIT_FROM = 3.0

#: Maximum fraction of samples that hit back faces for a patch with interpolated light. With more, a surface
#: is close to the patch, such as a panel below a ceiling. It is 1 - FRONTS of kernels/solve/interpolate.cl.
MAX_BACKS_INTERPOLATED = 0.1

#: A probe of a volume is invalid if more than this fraction of its directions hit dark back faces (Majercik
#: et al., "Scaling Probe-Based Real-Time Dynamic Global Illumination for Production", JCGT 2021).
MAX_BACKS_PROBE = 0.25

#: `LIT_FROM` as a build option.
LIT_FROM_OPTION = f"-DLIT_FROM={LIT_FROM}f"

#: Records and kernel files that include probe rays, built as one program: faster than four builds.
SOURCE: Source = (RECEIVER, "backs_around.cl", "contacts.cl", "lit_by_backs.cl", "push_off.cl")

#: The thresholds as build options of kernels that include probe rays.
KERNEL_OPTIONS = (
    f"-DMAX_ESCAPES={MAX_ESCAPES}",
    f"-DMAX_BACKS_OUTSIDE={MAX_BACKS_OUTSIDE}",
    f"-DMAX_BACKS_OPEN={MAX_BACKS_OPEN}",
    f"-DMAX_OTHERS_BACKLIT={MAX_OTHERS_BACKLIT}",
    f"-DFIRST_PROBES={FIRST_PROBES}",
    LIT_FROM_OPTION,
)

#: Program of kernels that read the light of patches or look for substitutes.
SENDERS: Source = ("lit_backs.cl", "substitutes.cl")
