"""Parametric furniture. Each function makes one piece in the style of a house: origin below its centre, front +Z."""
