"""Gathering: from visibility samples of patches and radiance of what they hit to irradiance.

All gathers share the interface in `interface`; they differ in where visibility samples are stored:

class             interface     visibility samples                     used for
CachedGather      DeviceGather  stored for all patches                 iterations, if the cache fits in memory
StreamGather      DeviceGather  recomputed, some patches at a time     iterations and final gathers, raster
RayStreamGather   DeviceGather  traced, never stored                   iterations and final gathers, by rays
LightGroupGather  DeviceGather  stored, read once for all light groups iterations of light groups
RemoteIteration   DeviceGather  stored on devices of other processes   iterations of a distributed bake
GatherPass        PointGather   of the DeviceGather that it wraps      final gather on this device
RemoteGatherPass  PointGather   traced by other processes              final gather of a distributed bake
LightGroupPass    Gather        recomputed, some receivers at a time   final gather of light groups
PaperGather       Gather        radiance hemicubes, drawn each time    method "paper"
ShaderGather      Gather        traced by OpenGL, stored up to 1 GiB   without OpenCL, visibility by rays
GlslGather        Gather        item buffers, stored by OpenGL         without OpenCL, visibility by raster

`solve.interpolated_gather` combines a final gather with interpolation from patch groups.
"""
