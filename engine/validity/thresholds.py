"""Thresholds of validity: all numbers that decide whether a point lies inside geometry.

A ray sees a back face if the nearest surface along it shows its back. A back face that has patches of its own
and sends out light (`DARK_BACK`) is no sign of the inside of something and counts as a front.
"""

from __future__ import annotations

#: Probe rays from a point, stratified over the hemisphere of its normal with the density of the cosine:
#: LOOKS of kernels/visibility/probe_rays.cl.
PROBES = 16

#: A patch whose view holds more than this fraction of back faces is invalid. Measured by all samples of a
#: patch. Below 1: the foot of a box that is sunk in a floor sees a little of what is around it.
INVALID = 0.9

#: A patch whose view holds more than this fraction of back faces may be invalid: probes decide. Between
#: the sides of a thin wall that ends in a ceiling, a patch sees the front of the ceiling in up to half of
#: its view.
DOUBTFUL = 0.4

#: Of the probes of an invalid point, at most this many escape: meet nothing, or the front of a surface
#: that is itself outside. One, since a ray may slip through the edge between two faces.
MAX_ESCAPES = 1

#: The front of a surface is outside if at most this many probes from it meet back faces. In a corner
#: where a wall ends, fronts that are inside see one another, and back faces in a quarter of their view.
MAX_BACKS_OUTSIDE = PROBES // 4

#: A side of a face is open if at most this many probes from it meet back faces: it tells the walls of two
#: rooms that share a plane from a box on a floor, and keeps patches inside geometry apart from others in
#: a texel group.
MAX_BACKS_OPEN = PROBES // 2

#: A point that back faces light, as a ceiling behind a lamp's panel, sees something else in at most this
#: many probes.
MAX_OTHERS_BACKLIT = 3

#: The first probes: if none of them meets a back face, a point is valid and no more are cast.
FIRST_PROBES, FIRST_PROBES_OPEN = 3, 4

#: A light is enclosed if this fraction of its rays meets back faces without patches. Below 1: gaps
#: between the parts of a lamp's body.
ENCLOSED = 0.98

#: A back face is dark, and tells of the inside of something, if it sends out less than this fraction of
#: the mean radiance of the scene. Texels that the wall of a hollow pillar crosses let in 1 to 2 % of the
#: light around its foot; backs that are lit on purpose send out more than a tenth of the mean.
DARK_BACK = 0.03

#: A lit back face counts as dark up to this distance, texels. Below the rim of a shell that lies on a floor,
#: light leaks in through texels that it crosses: dark fringes showed around the mounds of a garden. With 6,
#: the floor 1.5 texels below a roof of one plane is taken for an inside.
LIT_FROM = 3.0

#: Light is not interpolated to patches with more than this fraction of back faces in view: something stands
#: close to the surface, as a panel below a ceiling. FRONTS of interpolate.cl is the same number.
MAX_BACKS_INTERPOLATED = 0.1

#: The same numbers for kernels that include probes.
KERNEL_OPTIONS = (
    f"-DMAX_ESCAPES={MAX_ESCAPES}",
    f"-DMAX_BACKS_OUTSIDE={MAX_BACKS_OUTSIDE}",
    f"-DMAX_BACKS_OPEN={MAX_BACKS_OPEN}",
    f"-DMAX_OTHERS_BACKLIT={MAX_OTHERS_BACKLIT}",
    f"-DFIRST_PROBES={FIRST_PROBES}",
    f"-DFIRST_PROBES_OPEN={FIRST_PROBES_OPEN}",
    f"-DLIT_FROM={LIT_FROM}f",
)
