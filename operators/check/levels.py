"""Findings on levels of detail."""

from __future__ import annotations

from ..result.level_maps import TOO_FAR, far_levels
from ..scene import SceneContext
from .finding import WARNING, Finding, found


def check_levels(context: SceneContext, width: int) -> list[Finding]:
    """Return a finding on levels whose surface is far from that of their first level.

    width:  width of the lightmaps, texels
    """
    return found(WARNING, TOO_FAR, far_levels(context, width))
