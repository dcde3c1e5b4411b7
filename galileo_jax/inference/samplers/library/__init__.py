"""The samplers that a posterior can be drawn with: one file each, named as the sampler."""
