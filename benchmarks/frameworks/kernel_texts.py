"""Source of the two sums for GLSL, OpenCL C and CUDA, with the differences as macros around it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class KernelText:
    """Source of a kernel whose work groups write one float4 each.

    inputs:  type and name of each array, in the words of OpenCL
    count:   what an array has of numbers that each group adds up
    body:    adds them up in `sum`, the items `item`, `item` + ITEMS, ... of the group `group`
    """

    name: str
    inputs: tuple[tuple[str, str], ...]
    count: str
    body: str


#: Kernel that only writes: its time is the cost of a launch.
NOTHING = KernelText("nothing", (), "none", "")

#: Hemicubes to irradiance: each group weighs the texels of one (paper, IV.C).
INTEGRATE = KernelText(
    "integrate",
    (("float4", "hemicubes"), ("float", "multiplier")),
    "texels",
    "for (int i = item; i < texels; i += ITEMS)\n"
    "        sum += multiplier[i] * hemicubes[group * texels + i];",
)

#: Kernel that gathers irradiance from cached patch numbers: each work group sums the radiance of one patch's
#: samples.
GATHER = KernelText(
    "gather",
    (("uint", "seen"), ("float4", "radiance"), ("float", "multiplier")),
    "samples",
    "for (int i = item; i < samples; i += ITEMS)\n"
    "        sum += multiplier[i] * radiance[seen[group * samples + i]];",
)

KERNELS = (NOTHING, INTEGRATE, GATHER)

_MAIN = """{{
    {shared}
    int item = {item}, group = {group};
    VEC4 sum = {zero};
    {body}
    shares[item] = sum;
    BARRIER
    for (int step = ITEMS / 2; step > 0; step /= 2) {{
        if (item < step)
            shares[item] += shares[item + step];
        BARRIER
    }}
    if (item == 0)
        result[group] = shares[0];
}}
"""

#: CUDA has no arithmetic of float4.
_CUDA_OPERATORS = """
__device__ float4 operator*(float a, float4 b) { return make_float4(a * b.x, a * b.y, a * b.z, a * b.w); }
__device__ void operator+=(float4 &a, const float4 b) { a.x += b.x; a.y += b.y; a.z += b.z; a.w += b.w; }
"""


def opencl_text(kernel: KernelText, items: int) -> str:
    """Return a kernel in OpenCL C, for groups of `items`: arguments are the inputs, the result, the count."""
    inputs = "".join(f"__global const {kind} *{name}, " for kind, name in kernel.inputs)
    main = _MAIN.format(
        shared="__local float4 shares[ITEMS];", item="get_local_id(0)", group="get_group_id(0)",
        zero="(float4)(0.0f)", body=kernel.body,
    )  # fmt: skip
    head = f"#define VEC4 float4\n#define ITEMS {items}\n#define BARRIER barrier(CLK_LOCAL_MEM_FENCE);\n"
    size = f"__attribute__((reqd_work_group_size({items}, 1, 1)))"
    result = f"__global float4 *result, const int {kernel.count}"
    return f"{head}__kernel {size} void {kernel.name}({inputs}{result})\n{main}"


def cuda_text(kernel: KernelText, items: int) -> str:
    """Return a kernel in CUDA C++, with the same arguments."""
    kinds = {"uint": "unsigned int"}
    inputs = "".join(f"const {kinds.get(kind, kind)} *{name}, " for kind, name in kernel.inputs)
    main = _MAIN.format(
        shared="__shared__ float4 shares[ITEMS];", item="threadIdx.x", group="blockIdx.x",
        zero="make_float4(0, 0, 0, 0)", body=kernel.body,
    )  # fmt: skip
    head = f"#define VEC4 float4\n#define ITEMS {items}\n#define BARRIER __syncthreads();\n{_CUDA_OPERATORS}"
    result = f"float4 *result, const int {kernel.count}"
    return f'{head}extern "C" __global__ void {kernel.name}({inputs}{result})\n{main}'


def glsl_text(kernel: KernelText, items: int) -> str:
    """Return a compute shader: storage blocks are the inputs and the result, in this order."""
    kinds = {"float4": "vec4"}
    blocks = [
        f"layout(std430, binding = {i}) readonly buffer Input{i} {{ {kinds.get(kind, kind)} {name}[]; }};"
        for i, (kind, name) in enumerate(kernel.inputs)
    ]
    blocks.append(
        f"layout(std430, binding = {len(blocks)}) writeonly buffer Result {{ vec4 result[]; }};\n"
        f"uniform int {kernel.count};\nshared vec4 shares[ITEMS];"
    )
    main = _MAIN.format(
        shared="", item="int(gl_LocalInvocationID.x)", group="int(gl_WorkGroupID.x)", zero="vec4(0.0)",
        body=kernel.body,
    )  # fmt: skip
    head = f"#version 430\n#define VEC4 vec4\n#define ITEMS {items}\n#define BARRIER barrier();\n"
    return f"{head}layout(local_size_x = ITEMS) in;\n" + "\n".join(blocks) + f"\nvoid main()\n{main}"
