"""The laws of half-physics, measured on any simulator."""
