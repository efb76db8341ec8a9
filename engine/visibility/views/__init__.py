"""Where patches look from, and in which directions."""
