"""Importers of real drives' data, and the effects' equations fitted to them."""
