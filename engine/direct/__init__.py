"""Direct light: lamps, small bright surfaces and bright sky, by shadow rays."""
