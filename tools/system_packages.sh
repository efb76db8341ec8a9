#!/usr/bin/env bash
# Check by trying that Blender's module, OpenGL and OpenCL find their system libraries, and install
# the packages of those that are missing (Debian, Ubuntu; as root), else say which they are.
#
#     tools/system_packages.sh PYTHON      the Python of an environment with the requirements
set -euo pipefail
cd "$(dirname "$0")/.."
python=${1:?"usage: tools/system_packages.sh PYTHON"}

# The package of a shared library that bpy is linked with.
package_of() {
    case $1 in
        libEGL.so.*)        echo libegl1 ;;
        libGL.so.*)         echo libgl1 ;;
        libICE.so.*)        echo libice6 ;;
        libSM.so.*)         echo libsm6 ;;
        libX11.so.*)        echo libx11-6 ;;
        libXext.so.*)       echo libxext6 ;;
        libXfixes.so.*)     echo libxfixes3 ;;
        libXi.so.*)         echo libxi6 ;;
        libXrender.so.*)    echo libxrender1 ;;
        libXt.so.*)         echo libxt6 ;;
        libXxf86vm.so.*)    echo libxxf86vm1 ;;
        libgomp.so.*)       echo libgomp1 ;;
        libxkbcommon.so.*)  echo libxkbcommon0 ;;
        *)                  echo "$1" ;;
    esac
}

# Blender: the libraries that the loader does not find for the module.
blender_packages() {
    local module library
    module=$("$python" -c "import importlib.util as u; print(u.find_spec('bpy').origin)")
    ldd "$module" | awk '/not found/ { print $1 }' | while read -r library; do package_of "$library"; done
}

# OpenGL: a context as the engine makes it; without a graphics card Mesa draws on the processor.
opengl_packages() {
    "$python" -c "from engine.device.gl_context import GraphicsContext; GraphicsContext().release()" 2>/dev/null ||
        echo libegl1 libgl1 libgl1-mesa-dri
}

# OpenCL: a kernel built and run as the engine does it. The PoCL of the requirements is older than recent
# processors; any PoCL calls the linker of binutils when a kernel is first run, and ends the process without it.
opencl_packages() {
    run_kernel 2>/dev/null || echo binutils pocl-opencl-icd
}

run_kernel() {
    "$python" -c "
import numpy as np
from engine.device.buffers import upload_float4
from engine.device.cl_device import ComputeDevice
compute = ComputeDevice()
upload_float4(compute, np.zeros((1, 3), np.float32))
compute.queue.finish()"
}

missing() {
    { blender_packages; opengl_packages; opencl_packages; } | tr ' ' '\n' | sort -u | xargs
}

packages=$(missing)
if [ -z "$packages" ]; then
    exit 0
fi
if [ "$(id -u)" -ne 0 ] || ! command -v apt-get >/dev/null; then
    echo "System libraries are missing. On Debian or Ubuntu install them with" >&2
    echo "    sudo apt-get install $packages" >&2
    echo "and run this again; elsewhere install the packages that hold the same libraries." >&2
    exit 1
fi

echo "Installing missing system libraries: $packages"
export DEBIAN_FRONTEND=noninteractive
apt-get update -qq
# shellcheck disable=SC2086
apt-get install -y -qq --no-install-recommends $packages >/dev/null

packages=$(missing)
if [ -n "$packages" ]; then
    echo "These libraries are still missing although their packages are installed: $packages" >&2
    "$python" -c "from engine.device.gl_context import GraphicsContext; GraphicsContext()" || true
    run_kernel || true
    exit 1
fi
