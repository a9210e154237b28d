"""Made once a scene: charts, texel records, buried texels."""
