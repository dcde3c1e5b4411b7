"""Following objects through a video, to hundredths of a pixel, with an honest error."""
