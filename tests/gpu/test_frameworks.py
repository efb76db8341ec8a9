"""Kernels in several frameworks agree with NumPy, and a wrong sum is detected."""

from dataclasses import replace

import pytest

from benchmarks.frameworks.comparison import gathering, integration, summed
from benchmarks.frameworks.glsl import GLSL
from benchmarks.frameworks.kernel_texts import KERNELS, cuda_text
from benchmarks.frameworks.opencl import OpenCL
from tools.paper_tables import between, frameworks_table


@pytest.mark.parametrize("kind", [GLSL, OpenCL])
def test_sums_are_those_of_numpy(kind):
    framework = kind()
    for case in (integration(3), gathering(37)):
        found = summed(framework, case)
        assert found["error"] < 1e-5 and found["kernel"] == found["by_items"][found["items"]]
    wrong = replace(integration(3), truth=integration(3).truth * (1 + 3e-5))
    with pytest.raises(RuntimeError, match=f"{kind.name} differs from NumPy in 'integrate'"):
        summed(framework, wrong)


def test_cuda_has_the_same_body():
    for kernel in KERNELS:
        text = cuda_text(kernel, 32)
        assert kernel.body in text and f"void {kernel.name}(" in text and "{{" not in text


def test_a_table_names_what_is_missing():
    result = {"machine": {"opencl": {"device": "Card"}}, "frameworks": {"CUDA": {"missing": "no CuPy"}}}
    table = frameworks_table([result])
    assert table.splitlines()[-1].startswith("| Card | CUDA: no CuPy | – |")
    page = between("a\n<!-- x -->\nold\n<!-- end of x -->\nb", "x", table)
    assert "old" not in page and page.startswith("a\n<!-- x -->\n| device") and page.endswith("-->\nb")
