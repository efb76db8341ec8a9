"""Sizes of packages that pages quote."""

from tools.packages.sizes import with_sizes


def test_sizes_of_tables_and_sentences_are_renewed(tmp_path):
    packages = []
    for ending, size in (("linux_x64", 5_249_999), ("macos_arm64", 2_750_001)):
        packages.append(tmp_path / f"hemibake-1.2.3-{ending}.zip")
        packages[-1].write_bytes(bytes(size))
    page = (
        "| Linux | `hemibake-VERSION-linux_x64.zip`, 9.9 MB |\n"
        "| Windows | `hemibake-VERSION-windows_x64.zip`, 3.3 MB |\n"
        "(13.1 MB for Linux, 7.7 MB for Windows, 7.2 MB for macOS). It takes 64 MB.\n"
    )
    assert with_sizes(page, packages) == (
        "| Linux | `hemibake-VERSION-linux_x64.zip`, 5.2 MB |\n"
        "| Windows | `hemibake-VERSION-windows_x64.zip`, 3.3 MB |\n"
        "(5.2 MB for Linux, 7.7 MB for Windows, 2.8 MB for macOS). It takes 64 MB.\n"
    )
