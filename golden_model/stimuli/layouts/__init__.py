"""Scenes from a seeded generator, on which policies, filters and defaults are chosen: nobody lays them out by hand."""
