"""What every emitter of rays shares: the collector, waves, shading of what is met."""
