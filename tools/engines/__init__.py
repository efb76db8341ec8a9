"""Engines that show what Hemibake exports."""
