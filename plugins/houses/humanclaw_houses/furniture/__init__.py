"""Parametric furniture. Every function draws one piece in the taste of a house: origin under its middle, front +Z."""
