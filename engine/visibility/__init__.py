"""What each patch sees."""
