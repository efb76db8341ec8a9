"""From what a patch sees to its irradiance."""
