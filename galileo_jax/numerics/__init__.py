"""Linear algebra and geometry that knows nothing of clips, models, or fits."""
