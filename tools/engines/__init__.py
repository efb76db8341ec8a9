"""Engines that display exported files for the tests."""
