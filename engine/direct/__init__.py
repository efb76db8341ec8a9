"""Direct lighting: shadow rays to lights, small bright surfaces and bright sky."""
