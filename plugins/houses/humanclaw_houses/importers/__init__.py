"""Furniture as other people publish it: what a collection offers, before any of it is read."""

from humanclaw_houses.importers.offers import Collection, Offer
from humanclaw_houses.importers.opening import open_collection

__all__ = ["Collection", "Offer", "open_collection"]
